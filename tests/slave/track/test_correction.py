import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.quaternion import Array
from slave.track.correction import Correction

MS = 1_000_000
finite = st.floats(-3.0, 3.0)
even = st.floats(30.0, 120.0)


def begun(e: float, r: float, p: float = 0.0, v: float = 0.0, even_per_s: float = 30.0) -> Correction:
    correction = Correction()
    old, new = np.array([[p + e], [v + r]]), np.array([[p], [v]])
    correction.begin(0, old, new, 30.0, np.array([even_per_s]))
    return correction


def left(correction: Correction, ms: float) -> Array:
    return correction.applied(round(ms * MS), np.zeros((2, 1)))


@given(finite, finite, finite, finite, even)
def test_position_and_velocity_begin_on_the_old_course_and_end_on_the_new(
    e: float, r: float, p: float, v: float, even_per_s: float
) -> None:
    correction = begun(e, r, p, v, even_per_s)
    old, new = np.array([[p + e], [v + r]]), np.array([[p], [v]])
    np.testing.assert_allclose(correction.applied(0, new.copy()), old, atol=1e-12)
    np.testing.assert_allclose(correction.applied(3000 * MS, new.copy()), new, atol=1e-6)


@given(finite, finite, even, st.floats(1.0, 500.0))
def test_the_velocity_is_the_slope_of_the_position(e: float, r: float, even_per_s: float, ms: float) -> None:
    correction = begun(e, r, even_per_s=even_per_s)
    before, here, after = (left(correction, ms + d) for d in (-0.01, 0.0, 0.01))
    assert (after[0] - before[0]) / 2e-5 == pytest.approx(here[1], abs=1e-3, rel=1e-3)


@given(st.floats(0.001, 0.2), even)
def test_a_difference_at_rest_never_passes_zero(e: float, even_per_s: float) -> None:
    correction = begun(e, 0.0, even_per_s=even_per_s)
    course = [float(left(correction, ms)[0, 0]) for ms in range(0, 600, 5)]
    assert all(a >= b >= 0.0 for a, b in itertools.pairwise(course))


@pytest.mark.parametrize(
    ("error_rad", "times"), [(0.25, 1.0), (0.5, 2.0), (0.7, 2.8), (0.701, 1.0), (-2.0, 1.0)]
)
def test_a_large_difference_takes_longer_but_the_guard_sees_a_jump(error_rad: float, times: float) -> None:
    at_ms = 100.0
    x = 30.0 / times * at_ms / 1e3
    expected = error_rad * math.exp(-x) * (1.0 + x)
    assert left(begun(error_rad, 0.0), at_ms)[0, 0] == pytest.approx(expected)


def test_on_an_even_movement_a_small_difference_decays_faster_and_a_large_one_does_not() -> None:
    small, large = (float(left(begun(e, 0.0, even_per_s=100.0), 40.0)[0, 0]) / e for e in (0.001, 0.24))
    x = 0.04 * 100.0
    assert small == pytest.approx(math.exp(-x) * (1.0 + x), rel=0.01)
    assert large > 5.0 * small


def test_no_joint_waits_for_another_joints_correction() -> None:
    both = Correction()
    both.begin(0, np.array([[0.1, 0.6], [1.0, 0.0]]), np.zeros((2, 2)), 30.0, np.full(2, 30.0))
    for ms in range(0, 200, 5):
        of_both = both.applied(ms * MS, np.zeros((2, 2)))
        np.testing.assert_array_equal(of_both[:, :1], left(begun(0.1, 1.0), ms))


def test_nothing_is_left_after_a_reset() -> None:
    correction = begun(1.0, 1.0)
    correction.reset()
    assert not left(correction, 0.0).any()
