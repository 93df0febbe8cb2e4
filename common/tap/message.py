"""One message of the tap: its number, its topic, the sender's monotonic clock, and the bytes themselves.

Numbers count for each reader, refused messages too, so that a reader knows what it missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgpack

from common.errors import CodecError

GREETING = "tap/greeting"
"""Topic of the first message, which says who sends."""
LONGEST = 400_000
"""Bytes of a message: what a socket takes at the kernel's usual limit of its buffer."""

MOST_CHOSEN = 1024
"""Bytes of a reader's choice."""

_pack = msgpack.Packer(autoreset=True).pack


class TapMessage(NamedTuple):
    """As it is read."""

    number: int
    topic: str
    stamp_ns: int
    payload: bytes


def encode(message: TapMessage) -> bytes:
    """The datagram."""
    out: bytes = _pack(message)
    return out


def decode(datagram: bytes) -> TapMessage:
    """Raises CodecError."""
    try:
        message = TapMessage(*msgpack.unpackb(datagram))
    except Exception:  # msgpack raises its own family, and the number of fields may be wrong
        raise CodecError("not a message of the tap") from None
    if tuple(map(type, message)) != (int, str, int, bytes):
        raise CodecError("a message of the tap has fields of other types")
    return message


def encode_choice(topics: Sequence[str]) -> bytes:
    """What a reader sends to hear only topics that begin so; the greeting comes anyway."""
    out: bytes = _pack(list(topics))
    return out


def decode_choice(datagram: bytes) -> tuple[str, ...]:
    """Raises CodecError."""
    try:
        topics = tuple(msgpack.unpackb(datagram))
    except Exception:  # msgpack raises its own family
        raise CodecError("a choice of topics that is none") from None
    if not all(isinstance(topic, str) for topic in topics):
        raise CodecError("a choice of topics that is none")
    return topics
