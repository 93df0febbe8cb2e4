"""How many bits a second the drives of a bus put on it: whether it can carry them. Pure."""

from __future__ import annotations

from common.can.config import BusConfig
from slave.servos.canopen.pdo import EFFORT_BYTES, INPUTS_BYTES, RPDO_BYTES, TPDO_BYTES

FASTEST_BIT_S = 1_000_000
"""Classic CAN ends here (ISO 11898-2); CANopen's frames are classic ones."""
BUSIEST = 0.9
"""Share of a bus that may be planned for: the worst data needs a tenth more stuff bits than the usual."""
WELL = 0.8
"""Up to this share answers come in time."""
_OVERHEAD_BITS, _STUFFED_BITS = 47, 34
"""Bits of a frame with an 11-bit identifier besides its data, gap included; and those that may be stuffed."""
_HEARTBEAT_BYTES = 1


def frame_bits(size: int) -> int:
    """A frame of `size` bytes with the stuff bits that are to be expected: half of the most there can be."""
    return _OVERHEAD_BITS + 8 * size + (_STUFFED_BITS + 8 * size - 1) // 8


def bits_per_s(
    drives: int,
    sync_hz: int,
    heartbeat_ms: int,
    drive_heartbeat_ms: int,
    telling: int = 0,
    efforts_a_sync: float = 0.0,
    limit_bits: int = 0,
) -> float:
    """SYNC, targets and answers of every drive, inputs and efforts of those that tell them, heartbeats.

    `limit_bits`: of all torque limits, with each SYNC.
    """
    a_sync: float = frame_bits(0) + drives * (frame_bits(RPDO_BYTES) + frame_bits(TPDO_BYTES))
    a_sync += telling * frame_bits(INPUTS_BYTES) + efforts_a_sync * frame_bits(EFFORT_BYTES) + limit_bits
    beats = 1000.0 / heartbeat_ms + drives * 1000.0 / drive_heartbeat_ms
    return sync_hz * a_sync + beats * frame_bits(_HEARTBEAT_BYTES)


def configured_bitrate(bus: BusConfig) -> int:
    """The bit rate that a file gives its adapter; the fastest there is where it gives none."""
    rate = bus.options.get("bitrate")
    return rate if isinstance(rate, int) and rate > 0 else FASTEST_BIT_S


def too_much(drives: int, sync_hz: int, bits_s: float, bitrate: int) -> str:
    """A text for why a bus cannot carry its drives and what to do; empty if it can."""
    if bits_s <= BUSIEST * bitrate:
        return ""
    per_sync = bits_s / sync_hz
    rates = [rate for rate in range(10, 201) if 1000 % rate == 0 and rate * per_sync <= BUSIEST * bitrate]
    lower = f"sync_hz at most {max(rates)}, or " if rates else ""
    return (
        f"{drives} drives at {sync_hz} Hz are {bits_s / 1e6:.2f} Mbit/s "
        f"on a bus of {bitrate / 1e6:g} Mbit/s: {lower}the drives on more buses"
        + ("" if bitrate >= FASTEST_BIT_S else f", or up to {FASTEST_BIT_S / 1e6:g} Mbit/s")
    )
