"""A message's sequence number and its stream, without decoding the rest. Pure.

The recorder does not know how many joints a robot has, and need not: a gap shows in the numbers alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgpack

from common.errors import CodecError
from common.wire.codec import MAX_PAYLOAD, READABLE
from common.wire.fields import MAX_ITEMS
from common.wire.video import decode_frame


@dataclass(frozen=True, slots=True)
class Number:
    """One message among those of its stream."""

    stream: int
    """Within which it counts: the lease of a command, the process of a state; 0 if there is one count."""
    value: int


_PLACES = {"command": (3, 4), "state": (17, 3)}
"""Where stream and number stand in the array of a message, by its kind; `common.wire.codec` packs it so."""


def number_of(payload: bytes) -> Number | None:
    """The number of a command, a state or a picture; None if the payload has none or cannot be read."""
    if payload[:4] == b"TVID":
        try:
            return Number(0, decode_frame(payload).number)
        except CodecError:
            return None
    if len(payload) > MAX_PAYLOAD:
        return None
    try:
        array = msgpack.unpackb(payload, use_list=False, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS)
    except Exception:  # as in the codec: garbage raises whatever it likes
        return None
    if type(array) is not tuple or len(array) < 2 or array[0] not in _PLACES or array[1] not in READABLE:
        return None
    places = _PLACES[array[0]]
    if len(array) <= max(places):
        return None
    stream, value = (array[place] for place in places)
    return Number(stream, value) if type(stream) is int and type(value) is int else None
