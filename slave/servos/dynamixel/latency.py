"""How late a serial adapter gives its bytes: measured, and what its driver says of its latency timer.

An FTDI chip collects bytes until its buffer is full or its latency timer has run out: 16 ms from the factory
and after each plugging in. Linux shows and sets it below /sys/bus/usb-serial/devices.
"""

from __future__ import annotations

import os
from pathlib import Path

BEST_MS = 1
_DEVICES = "sys/bus/usb-serial/devices"


def timer_file(device: str, root: Path = Path("/")) -> Path:
    """Where the driver keeps an adapter's latency timer; lasting names of the device are followed."""
    real = os.path.realpath(root / device.lstrip("/"))
    return root / _DEVICES / Path(real).name / "latency_timer"


def timer_ms(device: str, root: Path = Path("/")) -> int | None:
    """The adapter's latency timer; None where it has none, as a port of the mainboard or another chip."""
    try:
        return int(timer_file(device, root).read_text("ascii"))
    except (OSError, ValueError):
        return None


def advice(device: str, timer: int | None) -> str:
    """What to do about answers that come late."""
    if timer is None:
        return (
            "look at the USB adapter's latency timer (16 ms from the factory where it is FTDI's: "
            "set it to 1 ms), and at servos.dynamixel.reply_timeout_s"
        )
    name = timer_file(device).parent.name
    if timer <= BEST_MS:
        return f"the latency timer of {name} is {timer} ms already: raise servos.dynamixel.reply_timeout_s"
    return (
        f"the latency timer of {name} is {timer} ms: set it to {BEST_MS} ms with "
        f"`echo {BEST_MS} | sudo tee /{_DEVICES}/{name}/latency_timer`, for good by a udev rule "
        f'(ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{{latency_timer}}="{BEST_MS}")'
    )


def too_late(device: str, quickest_s: float, waited_s: float, root: Path = Path("/")) -> str:
    """A text for why servos that answer would be taken for silent; empty if they would not."""
    if quickest_s <= waited_s:
        return ""
    return (
        f"the quickest answer takes {1e3 * quickest_s:.1f} ms, "
        f"and reply_timeout_s waits {1e3 * waited_s:.1f} ms: {advice(device, timer_ms(device, root))}"
    )
