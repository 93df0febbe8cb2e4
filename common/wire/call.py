"""A person at the robot asks for an operator, or needs none any more: question and answer as bytes. Pure.

A call moves nothing and gives nobody a right: it is shown in the robot's summary until an operator takes the
robot or the person withdraws it.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgpack

from common.errors import CodecError
from common.wire import fields
from common.wire.fields import MAX_TEXT
from common.wire.summary import MOST_WORDS

VERSION = 1
_MOST_BYTES = 1000


@dataclass(frozen=True, slots=True)
class CallRequest:
    """What the person wants."""

    calls: bool
    """False: the call is withdrawn."""
    words: str = ""
    """Why, for the operators."""


@dataclass(frozen=True, slots=True)
class CallReply:
    """What the robot made of it."""

    done: bool
    text: str


def pack_call(request: CallRequest) -> bytes:
    """The request's bytes."""
    out: bytes = msgpack.packb(("call", VERSION, request.calls, request.words[:MOST_WORDS]))
    return out


def read_call(payload: bytes) -> CallRequest:
    """The request. Raises CodecError."""
    calls, words = _array(payload, "call")
    return CallRequest(fields.flag(calls), fields.text(words, MOST_WORDS))


def pack_call_reply(reply: CallReply) -> bytes:
    """The reply's bytes."""
    out: bytes = msgpack.packb(("called", VERSION, reply.done, fields.shorten(reply.text, MAX_TEXT)))
    return out


def read_call_reply(payload: bytes) -> CallReply:
    """The reply. Raises CodecError."""
    done, text = _array(payload, "called")
    return CallReply(fields.flag(done), fields.text(text, MAX_TEXT))


def _array(payload: bytes, kind: str) -> tuple[object, object]:
    if len(payload) > _MOST_BYTES:
        raise CodecError(f"{len(payload)} bytes, expected at most {_MOST_BYTES}")
    try:
        array = msgpack.unpackb(payload, use_list=False, max_array_len=64)
    except Exception as error:  # msgpack raises ValueError, TypeError and its own family on garbage
        raise CodecError(f"not msgpack: {type(error).__name__}") from None
    if type(array) is not tuple or len(array) < 4 or array[0] != kind or array[1] != VERSION:
        raise CodecError(f"not a message of kind {kind}, version {VERSION}")
    return array[2], array[3]
