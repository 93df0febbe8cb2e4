"""20 ms of a voice: a fixed header, then Opus; without a body it only says that its sender is muted.

Nothing of it is kept: no recorder hears these topics (`common.wire.topics`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from common.errors import CodecError

MAX_OPUS = 1275
"""Bytes of one Opus frame at most (RFC 6716, 3.2)."""
_HEADER = struct.Struct("<4sBBHIQ")
_MAGIC, _VERSION, _MUTED = b"TVOI", 1, 1
_MOST_SEQUENCE = (1 << 32) - 1


@dataclass(frozen=True, slots=True)
class VoicePacket:
    """One frame of 20 ms."""

    stream: int
    """Drawn by the process that sends; another one begins another stream."""
    sequence: int
    """Grows by one for every 20 ms that are sent."""
    muted: bool
    body: bytes = b""
    """Opus; empty where nothing is said."""


def encode_voice(packet: VoicePacket) -> bytes:
    """The packet's bytes. Raises CodecError for one that `decode_voice` would refuse."""
    _check(packet)
    flags = _MUTED if packet.muted else 0
    head = (_MAGIC, _VERSION, flags, len(packet.body), packet.sequence, packet.stream)
    return _HEADER.pack(*head) + packet.body


def decode_voice(payload: bytes) -> VoicePacket:
    """The packet. Raises CodecError, which says what is wrong with it."""
    if len(payload) < _HEADER.size:
        raise CodecError(f"{len(payload)} bytes of voice, expected at least {_HEADER.size}")
    magic, version, flags, length, sequence, stream = _HEADER.unpack_from(payload)
    if magic != _MAGIC or version != _VERSION:
        raise CodecError(f"not voice of version {_VERSION}")
    body = payload[_HEADER.size :]
    if len(body) != length:
        raise CodecError(f"{len(body)} bytes of Opus, the header says {length}")
    packet = VoicePacket(stream, sequence, bool(flags & _MUTED), body)
    _check(packet)
    return packet


def _check(packet: VoicePacket) -> None:
    if not 0 < packet.stream < 1 << 64 or not 0 <= packet.sequence <= _MOST_SEQUENCE:
        raise CodecError("the stream or the number of a voice packet is out of range")
    if len(packet.body) > MAX_OPUS:
        raise CodecError(f"{len(packet.body)} bytes of Opus, expected at most {MAX_OPUS}")
    if packet.muted and packet.body:
        raise CodecError("a muted voice packet says something")
