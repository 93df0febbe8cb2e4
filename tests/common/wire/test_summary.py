"""The summary and the call: what goes in comes out, and no bytes raise anything but CodecError."""

from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.call import CallReply, CallRequest, pack_call, pack_call_reply, read_call, read_call_reply
from common.wire.summary import MOST_BYTES, HomeCall, RobotSummary, decode_summary, encode_summary

FULL = RobotSummary(
    "robot-1", 7, 9, "hold", "disengaged by nurse-1", "nurse-1", "nurse-2", "nurse-3", "nurse-4", 2,
    HomeCall(12.5, "dressing"),
)  # fmt: skip


def test_a_summary_comes_out_as_it_went_in() -> None:
    assert decode_summary(encode_summary(FULL)) == FULL
    plain = RobotSummary("r", 1, 1, "boot", "")
    assert decode_summary(encode_summary(plain)) == plain


def test_the_longest_summary_fits_into_one_packet() -> None:
    name = "ü" * 32
    longest = RobotSummary(
        name, 2**32 - 1, 2**62, "estop", "ü" * 4000, name, name, name, name, 99, HomeCall(1e9, "ü" * 500)
    )
    payload = encode_summary(longest)
    assert len(payload) <= MOST_BYTES
    read = decode_summary(payload)
    assert read.call is not None
    assert len(read.call.words) == 80


def test_what_a_later_version_appends_is_not_read() -> None:
    array = msgpack.unpackb(encode_summary(FULL))
    assert decode_summary(msgpack.packb([*array, "new", 3])) == FULL


@given(st.binary(max_size=200))
def test_garbage_raises_codec_error_alone(payload: bytes) -> None:
    for read in (decode_summary, read_call, read_call_reply):
        with pytest.raises(CodecError):
            read(payload)


@given(st.integers(0, 12), st.none() | st.integers() | st.text() | st.binary() | st.lists(st.integers()))
def test_one_wrong_field_is_refused_or_read_as_it_is(place: int, value: object) -> None:
    array = msgpack.unpackb(encode_summary(FULL))
    array[place] = value
    try:
        payload = msgpack.packb(array)
    except (OverflowError, ValueError):
        return
    try:
        decode_summary(payload)
    except CodecError:
        return
    assert value is None or type(value) in (int, str)


def test_a_call_comes_out_as_it_went_in() -> None:
    assert read_call(pack_call(CallRequest(True, "help"))) == CallRequest(True, "help")
    assert read_call(pack_call(CallRequest(True, "x" * 200))).words == "x" * 80
    assert read_call_reply(pack_call_reply(CallReply(False, "no"))) == CallReply(False, "no")
