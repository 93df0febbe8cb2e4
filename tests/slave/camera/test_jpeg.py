from __future__ import annotations

import numpy as np
import pytest

from slave.camera.child import passed_on
from slave.camera.jpeg import LEVELS, Fitter, decode, shrink, size_of

PIXELS = np.random.default_rng(1).integers(0, 255, (240, 320, 3)).astype(np.uint8)


def test_a_picture_becomes_as_good_as_fits_and_no_larger() -> None:
    fitter = Fitter()
    for _ in LEVELS:
        jpeg, *_ = fitter.fit(PIXELS, 1_000_000)
    assert fitter.level == 0
    assert size_of(jpeg) == (320, 240)
    for most_bytes in (40_000, 20_000, 8_000, 3_000):
        jpeg, width, height = fitter.fit(PIXELS, most_bytes)
        assert len(jpeg) <= most_bytes
        assert size_of(jpeg) == (width, height)


def test_where_nothing_fits_it_is_the_worst_level() -> None:
    fitter = Fitter()
    jpeg, width, height = fitter.fit(PIXELS, 10)
    assert fitter.level == len(LEVELS) - 1
    assert (width, height) == (80, 60)
    assert len(jpeg) > 10


@pytest.mark.parametrize("share", [1, 2, 4])
def test_a_smaller_picture_shows_the_same(share: int) -> None:
    flat = np.zeros((240, 320, 3), np.uint8)
    flat[:, 160:] = (200, 100, 50)
    small = shrink(flat, share)
    assert small.shape == (240 // share, 320 // share, 3)
    np.testing.assert_array_equal(small[0, -1], (200, 100, 50))
    np.testing.assert_array_equal(small[0, 0], 0)


def test_a_camera_s_own_jpeg_passes_untouched_while_it_is_small_enough() -> None:
    fitter = Fitter()
    own, *_ = fitter.fit(PIXELS, 100_000)
    assert passed_on(5, own, len(own), fitter).body is own
    smaller = passed_on(5, own, len(own) // 3, fitter)
    assert len(smaller.body) <= len(own) // 3
    assert smaller.captured_ns == 5
    assert decode(smaller.body).shape == (smaller.height, smaller.width, 3)


def test_garbage_of_a_camera_is_refused() -> None:
    with pytest.raises(ValueError, match=r"."):
        passed_on(5, b"\xff\xd8 no picture \xff\xd9", 1000, Fitter())
