import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slave.track.blend import Blend, coast

MS = 1_000_000
finite = st.floats(-3.0, 3.0)


@given(finite, finite, finite, finite)
def test_a_change_begins_on_the_old_course_and_ends_on_the_new(
    e: float, r: float, p: float, v: float
) -> None:
    blend = Blend(0.08)
    old, new = np.array([[e], [r]]), np.array([[p], [v]])
    blend.begin(0, old, new)
    np.testing.assert_allclose(blend.applied(0, new), old, atol=1e-12)
    np.testing.assert_allclose(blend.applied(80 * MS - 1, new), new, atol=1e-5)
    assert blend.applied(80 * MS, new) is new


def test_the_velocity_is_the_slope_of_the_position() -> None:
    blend, zero = Blend(0.08), np.zeros((2, 1))
    blend.begin(0, np.array([[0.3], [-2.0]]), zero)
    for ms in range(5, 75, 5):
        before, here, after = (blend.applied(ms * MS + d, zero) for d in (-MS // 100, 0, MS // 100))
        assert (after[0] - before[0]) / 2e-5 == pytest.approx(here[1], abs=1e-4)


def test_nothing_is_left_after_a_reset() -> None:
    blend, zero = Blend(0.08), np.zeros((2, 1))
    blend.begin(0, np.ones((2, 1)), zero)
    blend.reset()
    assert blend.applied(1, zero) is zero


def test_coasting_is_at_full_rate_then_slows_smoothly_to_rest() -> None:
    assert coast(0.1, 0.15, 0.3) == (0.1, 1.0)
    assert coast(0.15, 0.15, 0.3) == (0.15, 1.0)
    assert coast(0.3, 0.15, 0.3) == pytest.approx((0.225, 0.0))
    assert coast(9.0, 0.15, 0.3) == pytest.approx((0.225, 0.0))
    for age_s in np.linspace(0.001, 0.4, 100).tolist():
        (before, _), (_, rate), (after, _) = (coast(age_s + d, 0.15, 0.3) for d in (-1e-6, 0.0, 1e-6))
        assert (after - before) / 2e-6 == pytest.approx(rate, abs=1e-4)
