"""A beat of a deadman that is held in another process of this host, as a datagram. Pure.

Both processes read one monotonic clock, so that a beat which lay in a queue is known to be old.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from common.errors import CodecError

PERIOD_S = 0.05
_FORM = struct.Struct("<4sBBxxQQ")
_MAGIC, _VERSION = b"THLD", 1


@dataclass(frozen=True, slots=True)
class DeadmanBeat:
    """One beat."""

    down: bool
    """Whether somebody holds."""
    number: int
    """Grows from beat to beat of one process."""
    sent_ns: int
    """This host's monotonic clock."""


def encode_beat(beat: DeadmanBeat) -> bytes:
    """The datagram."""
    return _FORM.pack(_MAGIC, _VERSION, beat.down, beat.number, beat.sent_ns)


def decode_beat(datagram: bytes) -> DeadmanBeat:
    """Raises CodecError."""
    try:
        magic, version, down, number, sent_ns = _FORM.unpack(datagram)
    except struct.error:
        raise CodecError(f"{len(datagram)} bytes are no beat of a deadman") from None
    if magic != _MAGIC or version != _VERSION or down > 1:
        raise CodecError("not a beat of a deadman of this version")
    return DeadmanBeat(bool(down), number, sent_ns)
