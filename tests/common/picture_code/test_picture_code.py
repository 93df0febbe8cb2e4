"""A code is read back from what a camera, a compression and a screen make of it, or not at all."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import simplejpeg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from common.picture_code import (
    CODE_STEP_NS,
    count_of,
    draw_code,
    newest_ns,
    paste_code,
    read_codes,
    resolve_ns,
)
from common.picture_code.cells import cells_of, count_in

Pixels = NDArray[np.uint8]
TIMES = st.integers(0, 2**62)


def room(height: int = 240, width: int = 320, seed: int = 0) -> Pixels:
    """A wall, a floor, a dark door and noise."""
    pixels = np.empty((height, width, 3), np.uint8)
    pixels[: height // 2], pixels[height // 2 :] = (200, 205, 198), (120, 100, 84)
    pixels[height // 4 : height // 2, width // 2 : width // 2 + width // 8] = (40, 35, 30)
    return pixels + np.random.default_rng(seed).integers(0, 20, pixels.shape, dtype=np.uint8)


def through_jpeg(pixels: Pixels, quality: int) -> Pixels:
    jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(pixels), quality=quality, colorsubsampling="420")
    decoded: Pixels = simplejpeg.decode_jpeg(jpeg)
    return decoded


def seen_at_an_angle(code: Pixels, corners: list[tuple[float, float]], background: Pixels) -> Pixels:
    """The code (luma) as a camera sees it whose corners (column, row) come to lie there."""
    height, width = code.shape
    flat = [(0, 0), (width, 0), (width, height), (0, height)]
    rows, values = [], []
    for (x, y), (u, v) in zip(corners, flat, strict=True):
        rows += [(x, y, 1, 0, 0, 0, -x * u, -y * u), (0, 0, 0, x, y, 1, -x * v, -y * v)]
        values += [u, v]
    a, b, c, d, e, f, g, h = np.linalg.solve(np.array(rows), np.array(values))
    y, x = np.mgrid[: background.shape[0], : background.shape[1]]
    scale = g * x + h * y + 1
    u, v = (a * x + b * y + c) / scale, (d * x + e * y + f) / scale
    inside = (u >= 0) & (u < width - 1) & (v >= 0) & (v < height - 1)
    seen = ndimage.map_coordinates(code.astype(float), (v, u), order=1, mode="nearest")
    out = background.copy()
    out[inside] = seen[inside, None]
    return out


@given(TIMES)
def test_cells_say_the_time_within_its_step(time_ns: int) -> None:
    count = count_in(cells_of(count_of(time_ns)))
    assert count is not None
    assert 0 <= time_ns - resolve_ns(count, time_ns) < CODE_STEP_NS


@given(TIMES, st.integers(-59 * 3600 * 10**9, 59 * 3600 * 10**9))
def test_a_count_is_resolved_by_a_clock_that_is_hours_off(time_ns: int, off_ns: int) -> None:
    assert resolve_ns(count_of(time_ns), max(0, time_ns + off_ns)) == time_ns // CODE_STEP_NS * CODE_STEP_NS


@given(TIMES, st.sets(st.integers(0, 47), min_size=1, max_size=3))
def test_up_to_three_wrong_cells_are_always_refused(time_ns: int, wrong: set[int]) -> None:
    cells = cells_of(count_of(time_ns)).ravel()
    cells[list(wrong)] ^= True
    assert count_in(cells.reshape(6, 8)) is None


@settings(max_examples=40, deadline=None)
@given(TIMES, st.integers(2, 8), st.sampled_from([85, 50, 35, 20]), st.integers(0, 120), st.integers(0, 220))
def test_it_survives_jpeg_wherever_it_stands(
    time_ns: int, cell_px: int, quality: int, row: int, column: int
) -> None:
    pixels = room()
    paste_code(pixels, time_ns, (row, column), cell_px)
    assert [code.count for code in read_codes(through_jpeg(pixels, quality))] == [count_of(time_ns)]


@pytest.mark.parametrize("light", [0.35, 0.6, 1.0])
@pytest.mark.parametrize("tilt", [0.0, 8.0, 20.0])
def test_it_is_read_at_an_angle_in_poor_light(tilt: float, light: float) -> None:
    for time_ns in (123_456_789_000_000, 5, 2**50):
        corners = [(60.0, 50.0 + tilt), (220.0, 60.0 - tilt), (210.0, 180.0 + tilt), (70.0, 170.0 - tilt)]
        pixels = seen_at_an_angle(draw_code(time_ns, 12), corners, room())
        dark = np.clip(pixels * light + 10, 0, 255).astype(np.uint8)
        assert [code.count for code in read_codes(through_jpeg(dark, 50))] == [count_of(time_ns)]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**50), st.integers(1, 600), st.floats(0.0, 1.0))
def test_a_blend_of_two_codes_is_one_of_them_or_nothing(time_ns: int, later_ms: int, share: float) -> None:
    later_ns = time_ns + later_ms * 1_000_000
    first, second = room(), room()
    paste_code(first, time_ns, (40, 40), 5)
    paste_code(second, later_ns, (40, 40), 5)
    blend = (first * (1 - share) + second * share).astype(np.uint8)
    found = {code.count for code in read_codes(blend)}
    assert found <= {count_of(time_ns), count_of(later_ns)}


def test_of_two_codes_that_take_turns_the_newest_whole_one_counts() -> None:
    pixels, before, after = room(), room(), room()
    for picture, right_ns in ((before, 10_000_000_000), (after, 10_033_000_000)):
        paste_code(picture, right_ns, (40, 180), 5)
    pixels = ((before.astype(float) + after) / 2).astype(np.uint8)
    paste_code(pixels, 10_016_700_000, (40, 40), 5)
    assert newest_ns(read_codes(pixels), 10_500_000_000) == 10_016_700_000
    assert newest_ns(read_codes(room()), 0) is None


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(5, 60))
def test_noise_is_no_code(seed: int, coarse: int) -> None:
    noise = np.random.default_rng(seed).integers(
        0, 256, (240 // coarse + 1, 320 // coarse + 1), dtype=np.uint8
    )
    pixels = np.kron(noise, np.ones((coarse, coarse), np.uint8)).astype(np.uint8)[:240, :320]
    assert read_codes(pixels) == []


def test_a_code_that_does_not_fit_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="72×60"):
        paste_code(room(), 0, (200, 0), 6)


def test_it_survives_h264_at_a_low_bitrate() -> None:
    av = pytest.importorskip("av", reason="the extra `h264` is not installed")
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = 320, 240, "yuv420p"
    encoder.time_base, encoder.framerate, encoder.bit_rate = Fraction(1, 12), Fraction(12), 150_000
    encoder.options = {"preset": "ultrafast", "tune": "zerolatency"}
    decoder = av.CodecContext.create("h264", "r")
    read = 0
    for i in range(36):
        pixels = room(seed=i)
        time_ns = 10**12 + i * 83_300_000
        paste_code(pixels, time_ns, (120, 10), 6)
        frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
        frame.pts = i
        for packet in encoder.encode(frame):
            for shown in decoder.decode(packet):
                found = [code.count for code in read_codes(shown.to_ndarray(format="rgb24"))]
                assert found in ([], [count_of(10**12 + shown.pts * 83_300_000)])
                read += len(found)
    assert read >= 30
