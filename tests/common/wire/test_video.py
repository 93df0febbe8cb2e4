from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.video import MAX_JPEG, VideoFrame, decode_frame, encode_frame

FRAME = VideoFrame(7, 10**12, 10**12 + 5, 320, 240, b"\xff\xd8 picture \xff\xd9")
COUNT = st.integers(0, 2**63 - 1)
QUICK = settings(max_examples=60, deadline=None, derandomize=True)


@QUICK
@given(
    st.builds(
        VideoFrame,
        number=st.integers(1, 2**63 - 1),
        captured_ns=COUNT,
        sent_ns=COUNT,
        width=st.integers(1, 65535),
        height=st.integers(1, 65535),
        jpeg=st.binary(max_size=200).map(lambda body: b"\xff\xd8" + body + b"\xff\xd9"),
    )
)
def test_a_frame_comes_back_as_it_went(frame: VideoFrame) -> None:
    assert decode_frame(encode_frame(frame)) == frame


@QUICK
@given(st.binary(max_size=300))
def test_garbage_is_refused_and_nothing_else_is_raised(payload: bytes) -> None:
    with pytest.raises(CodecError):
        decode_frame(payload)


@QUICK
@given(st.integers(0, 55), st.integers(1, 255))
def test_a_frame_with_one_byte_changed_is_refused_or_still_a_frame(place: int, flip: int) -> None:
    payload = bytearray(encode_frame(FRAME))
    payload[place % len(payload)] ^= flip
    try:
        frame = decode_frame(bytes(payload))
    except CodecError:
        return
    assert len(frame.jpeg) == len(FRAME.jpeg)


@pytest.mark.parametrize("cut", [0, 3, 39, 40, 45])
def test_a_frame_cut_short_is_refused(cut: int) -> None:
    with pytest.raises(CodecError):
        decode_frame(encode_frame(FRAME)[:cut])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (replace(FRAME, number=0), "63-bit"),
        (replace(FRAME, captured_ns=2**63), "63-bit"),
        (replace(FRAME, captured_ns=-1), "cannot be encoded"),
        (replace(FRAME, width=0), "picture of 0×240"),
        (replace(FRAME, width=65536), "cannot be encoded"),
        (replace(FRAME, jpeg=b"GIF89a"), "not a whole JPEG"),
        (replace(FRAME, jpeg=b"\xff\xd8" + bytes(MAX_JPEG) + b"\xff\xd9"), "at most"),
    ],
)
def test_what_is_no_frame_is_not_sent(wrong: VideoFrame, said: str) -> None:
    with pytest.raises(CodecError, match=said):
        encode_frame(wrong)


def test_another_version_is_refused_by_name() -> None:
    payload = bytearray(encode_frame(FRAME))
    payload[4] = 9
    with pytest.raises(CodecError, match="version 9, expected 1"):
        decode_frame(bytes(payload))
