import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slave.track.blend import Blend, coast

MS = 1_000_000
finite = st.floats(-3.0, 3.0)


small = st.floats(-0.24, 0.24)


@given(small, finite, finite, finite)
def test_a_change_begins_on_the_old_course_and_ends_on_the_new(
    e: float, r: float, p: float, v: float
) -> None:
    blend = Blend(0.08)
    old, new = np.array([[p + e], [v + r]]), np.array([[p], [v]])
    blend.begin(0, old, new)
    np.testing.assert_allclose(blend.applied(0, new), old, atol=1e-12)
    np.testing.assert_allclose(blend.applied(80 * MS - 1, new), new, atol=1e-5)
    assert blend.applied(80 * MS, new) is new


@pytest.mark.parametrize(
    ("error_rad", "times"), [(0.25, 1.0), (0.5, 2.0), (-0.625, 2.5), (0.7, 2.8), (0.701, 1.0), (-2.0, 1.0)]
)
def test_a_large_difference_takes_longer_but_the_guard_sees_a_jump(error_rad: float, times: float) -> None:
    blend, new = Blend(0.08), np.zeros((2, 1))
    old = np.array([[error_rad], [0.0]])
    blend.begin(0, old, new)
    end_ns = round(80 * MS * times)
    assert abs(blend.applied(end_ns - MS, new)[0, 0]) > 0.0
    assert blend.applied(end_ns, new) is new
    blend.begin(0, old, new)
    fastest = max(abs(blend.applied(k * MS, new)[1, 0]) for k in range(end_ns // MS))
    assert fastest <= 1.5 * abs(error_rad) / (0.08 * times) + 1e-9


def test_no_joint_waits_for_another_joints_correction() -> None:
    """A joint whose nodes are lost is 0 in the next command: the others go on as if nothing were."""
    alone, both = Blend(0.08), Blend(0.08)
    alone.begin(0, np.array([[0.1], [1.0]]), np.zeros((2, 1)))
    both.begin(0, np.array([[0.1, 0.6], [1.0, 0.0]]), np.zeros((2, 2)))
    for k in range(0, 79, 5):
        one, of_both = alone.applied(k * MS, np.zeros((2, 1))), both.applied(k * MS, np.zeros((2, 2)))
        np.testing.assert_array_equal(of_both[:, :1], one)
    assert both.applied(100 * MS, np.zeros((2, 2)))[0, 0] == 0.0
    assert both.applied(100 * MS, np.zeros((2, 2)))[0, 1] > 0.0


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
