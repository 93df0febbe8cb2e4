"""Which input devices the kernel knows, by sysfs: also those that this user may not open."""

from __future__ import annotations

import os
from collections.abc import Sequence, Set
from dataclasses import dataclass
from pathlib import Path

BITS_PER_WORD = 64
ROOT = Path("/")


@dataclass(frozen=True, slots=True)
class ListedDevice:
    """One input device."""

    path: str
    """Its file, such as /dev/input/event5: another one after the next start."""
    name: str
    place: str
    """Where it is plugged in, by the kernel; two of one model differ in it."""
    keys: frozenset[int]
    """Codes of the keys that it has."""
    readable: bool
    """Whether this user may open it."""
    repeats: bool
    """Whether the kernel repeats its held keys."""


def list_devices(root: Path = ROOT) -> list[ListedDevice]:
    """All of them, in the order of their numbers. `root`: of the tree that has /sys and /dev."""
    found = (root / "sys/class/input").glob("event*")
    return [_read(root, at) for at in sorted(found, key=lambda at: int(at.name.removeprefix("event") or 0))]


def choose(devices: Sequence[ListedDevice], name: str, codes: Set[int]) -> tuple[str, str]:
    """Path of the one device of this name that has the keys, or an empty text and why there is none.

    One pedal shows as several devices (a keyboard, a mouse, a gamepad), some of one name.
    """
    named = [device for device in devices if device.name == name]
    having = [device for device in named if codes <= device.keys]
    if len(having) == 1:
        return having[0].path, ""
    if having:
        places = ", ".join(f"{device.path} at {device.place or 'an unknown place'}" for device in having)
        return "", f"{len(having)} devices are named {name!r}: {places}; give a path below /dev/input/by-path"
    if named:
        return "", f"{name!r} has not the keys asked for: `tandem inputs` shows which it has"
    return "", f"no input device is named {name!r}: plug it in; `tandem inputs` lists those that are there"


def _read(root: Path, at: Path) -> ListedDevice:
    path = f"/dev/input/{at.name}"
    device = at / "device"
    return ListedDevice(
        path=path,
        name=_text(device / "name"),
        place=_text(device / "phys"),
        keys=_bits(_text(device / "capabilities/key")),
        readable=os.access(root / path.lstrip("/"), os.R_OK),
        repeats=20 in _bits(_text(device / "capabilities/ev")),
    )


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8", "replace").strip()
    except OSError:  # unplugged meanwhile
        return ""


def _bits(text: str) -> frozenset[int]:
    """The set bits of a bitmap as sysfs prints it: hexadecimal words, the highest first."""
    words = [int(word, 16) for word in text.split()][::-1]
    return frozenset(
        place * BITS_PER_WORD + bit
        for place, word in enumerate(words)
        for bit in range(BITS_PER_WORD)
        if word >> bit & 1
    )
