"""Pictures of a recording as pixels, in both codecs, with gaps and damage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import simplejpeg

from common.picture_code import count_of, paste_code, read_codes
from common.wire.video import VideoFrame
from deploy.recorded.held import _Newest
from deploy.recorded.pictures import PictureDecoder, as_jpeg
from slave.camera.h264 import H264Fitter
from slave.camera.jpeg import Pixels

av = pytest.importorskip("av", reason="the extra `h264` is not installed")


def picture(number: int) -> Pixels:
    pixels = np.full((240, 320, 3), 150, np.uint8)
    paste_code(pixels, number * 10**9, (80, 80), 8)
    return pixels


def stream(count: int, alone: frozenset[int] = frozenset()) -> list[VideoFrame]:
    fitter, frames = H264Fitter(12.0), []
    for number in range(1, count + 1):
        made = fitter.fit(picture(number), 10_000, number in alone)
        after = 0 if made.alone else number - 1
        frames.append(VideoFrame(number, number, number, 320, 240, made.body, "h264", after))
    return frames


def shown(frames: list[VideoFrame], decoder: PictureDecoder) -> list[int | None]:
    """Which picture each one shows, by the code in its pixels."""
    out: list[int | None] = []
    for frame in frames:
        pixels = decoder.decode(frame)
        codes = [] if pixels is None else read_codes(pixels)
        out.append(codes[0].count * 100_000 // 10**9 if codes else None)
    return out


def test_each_picture_shows_what_it_was_made_of() -> None:
    assert shown(stream(8), PictureDecoder()) == list(range(1, 9))
    jpeg = VideoFrame(1, 1, 1, 320, 240, simplejpeg.encode_jpeg(picture(1)))
    assert shown([jpeg], PictureDecoder()) == [1]


def test_after_a_gap_nothing_is_shown_until_one_stands_alone() -> None:
    frames = stream(10, frozenset({7}))
    decoder = PictureDecoder()
    assert shown(frames[:3] + frames[4:], decoder) == [1, 2, 3, None, None, 7, 8, 9, 10]
    assert decoder.chain.broken == 2


def test_a_damaged_picture_and_those_that_build_on_it_are_not_shown() -> None:
    frames = stream(8, frozenset({6}))
    frames[2] = replace(frames[2], body=b"\0\0\0\1" + bytes(40))
    decoder = PictureDecoder()
    assert shown(frames, decoder) == [1, 2, None, None, None, 6, 7, 8]
    assert decoder.undecodable == 1


def test_a_picture_of_h264_becomes_a_jpeg_and_a_jpeg_stays_as_it_is() -> None:
    frame = stream(1)[0]
    pixels = PictureDecoder().decode(frame)
    assert pixels is not None
    again = simplejpeg.decode_jpeg(as_jpeg(frame, pixels))
    assert [code.count for code in read_codes(again)] == [count_of(10**9)]
    jpeg = replace(frame, body=simplejpeg.encode_jpeg(picture(1)), codec="jpeg")
    assert as_jpeg(jpeg, pixels) is jpeg.body


def test_an_export_holds_h264_as_jpeg_and_skips_what_cannot_be_shown() -> None:
    newest = _Newest(25)
    frames = stream(6, frozenset({5}))
    shown_numbers = []
    for frame in frames[:2] + frames[3:]:
        newest._picture("head", frame)
        held = newest.pictures["head"]
        assert held.codec == "jpeg"
        codes = read_codes(simplejpeg.decode_jpeg(held.body))
        shown_numbers.append((held.number, codes[0].count * 100_000 // 10**9))
    assert shown_numbers == [(1, 1), (2, 2), (2, 2), (5, 5), (6, 6)]


def test_a_viewer_s_copy_has_h264_in_the_schema_for_video() -> None:
    protobuf = pytest.importorskip("deploy.viewer.protobuf")
    pytest.importorskip("foxglove_schemas_protobuf", reason="the extra `viewer` is not installed")
    frame = stream(1)[0]
    message = protobuf.picture(frame, "camera_head", 1_700_000_000_000_000_000)
    assert (message.DESCRIPTOR.full_name, message.format) == ("foxglove.CompressedVideo", "h264")
    assert message.data == frame.body
    jpeg = replace(frame, body=simplejpeg.encode_jpeg(picture(1)), codec="jpeg")
    assert protobuf.picture(jpeg, "camera_head", 1).DESCRIPTOR.full_name == "foxglove.CompressedImage"
