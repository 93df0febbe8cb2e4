from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.video import H264, MAX_PICTURE, FrameChain, VideoFrame, decode_frame, encode_frame

FRAME = VideoFrame(7, 10**12, 10**12 + 5, 320, 240, b"\xff\xd8 picture \xff\xd9")
KEY = replace(FRAME, body=b"\0\0\0\1 picture", codec=H264)
NEXT = replace(KEY, number=8, after=7)
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
        body=st.binary(max_size=200).map(lambda body: b"\xff\xd8" + body + b"\xff\xd9"),
    )
)
def test_a_frame_comes_back_as_it_went(frame: VideoFrame) -> None:
    assert decode_frame(encode_frame(frame)) == frame


@QUICK
@given(st.integers(1, 2**63 - 1), st.data(), st.binary(max_size=200))
def test_a_frame_of_h264_comes_back_with_what_it_builds_on(
    number: int, data: st.DataObject, body: bytes
) -> None:
    frame = replace(KEY, number=number, after=data.draw(st.integers(0, number - 1)), body=b"\0\0\1" + body)
    assert decode_frame(encode_frame(frame)) == frame


def test_a_jpeg_travels_as_it_did_before_there_was_h264() -> None:
    assert encode_frame(FRAME)[:5] == b"TVID\x01"
    assert len(encode_frame(FRAME)) == 40 + len(FRAME.body)


@QUICK
@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60))
def test_a_picture_is_shown_only_where_all_since_one_that_stands_alone_were(
    sent: list[tuple[bool, bool]],
) -> None:
    chain, last, whole = FrameChain(), 0, False
    for number, (alone, arrives) in enumerate(sent, start=1):
        frame = replace(KEY, number=number, after=0 if alone or not last else last)
        last = number
        whole = arrives if frame.after == 0 else whole and arrives
        if arrives:
            assert chain.take(frame) is whole
            assert chain.wants_key is not whole


def test_after_a_picture_that_could_not_be_decoded_one_that_stands_alone_is_wanted() -> None:
    chain = FrameChain()
    assert chain.take(KEY)
    chain.lose()
    assert not chain.take(NEXT)
    assert chain.wants_key
    assert chain.take(replace(KEY, number=9))


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
    assert len(frame.body) == len(FRAME.body)


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
        (replace(FRAME, body=b"GIF89a"), "not a whole JPEG"),
        (replace(FRAME, after=6), "builds on no other"),
        (replace(NEXT, after=8), "cannot build on picture 8"),
        (replace(NEXT, after=-1), "cannot be encoded"),
        (replace(KEY, body=b"\0\0\0\5 avc"), "start codes"),
        (replace(FRAME, body=b"\xff\xd8" + bytes(MAX_PICTURE) + b"\xff\xd9"), "at most"),
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
