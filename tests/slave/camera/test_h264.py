"""H.264 within a number of bytes: by a stream that a test plays, and by x264 itself."""

from __future__ import annotations

import numpy as np
import pytest

from common.picture_code import count_of, paste_code, read_codes
from slave.camera.h264 import H264Fitter, open_x264
from slave.camera.jpeg import Pixels


class Played:
    """Keeps how streams were opened."""

    def __init__(self) -> None:
        self.opened: list[tuple[int, int, int]] = []
        self._first = True

    def open(self, width: int, height: int, rate_hz: float, most_bytes: int) -> Played:
        self.opened.append((width, height, most_bytes))
        self._first = True
        return self

    def encode(self, pixels: Pixels, alone: bool) -> tuple[bytes, bool]:
        alone, self._first = alone or self._first, False
        return bytes(len(pixels) // 16), alone


def blank(height: int, width: int) -> Pixels:
    return np.zeros((height, width, 3), np.uint8)


def test_an_encoder_is_opened_anew_at_once_for_less_and_after_a_second_for_more() -> None:
    played = Played()
    fitter = H264Fitter(10.0, played.open)
    asked = [10_000, 9_000, 8_499, *[20_000] * 9, 20_000, 20_000]
    alone = [fitter.fit(blank(240, 320), most_bytes, alone=False).alone for most_bytes in asked]
    assert [most_bytes for *_, most_bytes in played.opened] == [10_000, 8_499, 20_000]
    assert [i for i, each in enumerate(alone) if each] == [0, 2, 12]


def test_a_poor_link_gets_a_half_and_a_quarter_and_the_size_does_not_swing() -> None:
    fitter = H264Fitter(10.0, Played().open)
    seen = [
        fitter.fit(blank(720, 1280), most_bytes, alone=False)
        for most_bytes in (7000, 6900, 7000, 1700, 7000, 11_100)
    ]
    assert [(one.width, one.height) for one in seen] == [
        (1280, 720), (640, 360), (640, 360), (320, 180), (640, 360), (1280, 720)
    ]  # fmt: skip


def room(count: int) -> list[Pixels]:
    rng = np.random.default_rng(1)
    wall = np.kron(rng.integers(60, 220, (15, 20, 3)), np.ones((16, 16, 1))).astype(np.uint8)
    pictures = []
    for i in range(count):
        moved = np.roll(wall, 3 * i, axis=1).copy()
        paste_code(moved, 10**12 + i * 80_000_000, (120, 10), 6)
        pictures.append(moved)
    return pictures


def test_x264_keeps_within_the_bytes_and_gives_each_picture_at_once() -> None:
    av = pytest.importorskip("av", reason="the extra `h264` is not installed")
    decoder = av.CodecContext.create("h264", "r")
    fitter = H264Fitter(12.0, open_x264)
    sizes, read = [], 0
    for i, pixels in enumerate(room(40)):
        most_bytes = 6000 if i < 20 else 3000
        made = fitter.fit(pixels, most_bytes, alone=i == 10)
        assert made.body.startswith(b"\0\0\0\1")
        assert made.alone == (i in (0, 10, 20))
        sizes.append(len(made.body) / most_bytes)
        (shown,) = decoder.decode(av.Packet(made.body))  # the same picture: none is held back
        assert (shown.width, shown.height) == (320, 240)
        found = [code.count for code in read_codes(shown.to_ndarray(format="rgb24"))]
        assert found in ([], [count_of(10**12 + i * 80_000_000)])
        read += len(found)
    assert max(sizes) < 1.25
    assert np.mean(sizes) < 1.0
    assert read >= 36


def test_each_picture_that_stands_alone_is_decoded_by_who_begins_with_it() -> None:
    av = pytest.importorskip("av", reason="the extra `h264` is not installed")
    fitter = H264Fitter(12.0, open_x264)
    made = [fitter.fit(pixels, 6000, alone=i % 5 == 0) for i, pixels in enumerate(room(15))]
    for begin in (0, 5, 10):
        decoder = av.CodecContext.create("h264", "r")
        assert sum(len(decoder.decode(av.Packet(one.body))) for one in made[begin:]) == 15 - begin
