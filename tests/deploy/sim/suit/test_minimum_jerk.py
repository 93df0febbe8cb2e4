from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, MotionError, Move

NAMES = ("a", "b")
REST = np.array([0.1, -0.2])
THERE_AND_BACK = [Move("a", 0.5, 1.0, 1.3), Move("a", 2.0, 0.8, 0.1), Move("b", 0.7, 0.4, 0.3)]
BACK = Move("b", 2.5, 0.5, -0.2)


def motion() -> MinimumJerkMotion:
    return MinimumJerkMotion(NAMES, REST, [*THERE_AND_BACK, BACK], period_s=3.0)


def test_it_goes_from_rest_to_rest() -> None:
    position, velocity, acceleration = motion().state(np.array([0.0, 0.5, 1.5, 1.7, 2.9]))
    np.testing.assert_allclose(position[:, 0], [0.1, 0.1, 1.3, 1.3, 0.1])
    np.testing.assert_allclose(velocity[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(acceleration[:, 0], 0.0, atol=1e-12)


def test_half_way_it_is_half_way_and_fastest() -> None:
    position, velocity, acceleration = motion().state(1.0)
    assert position[0] == pytest.approx(0.7)
    assert velocity[0] == pytest.approx(1.875 * 1.2 / 1.0)
    assert acceleration[0] == pytest.approx(0.0, abs=1e-12)
    t_s = np.linspace(0.5, 1.5, 10_001)
    assert np.abs(motion().state(t_s)[1][:, 0]).max() == pytest.approx(velocity[0])
    assert np.abs(motion().state(t_s)[2][:, 0]).max() == pytest.approx(10.0 / np.sqrt(3.0) * 1.2, rel=1e-6)


@given(st.floats(0.0, 1e5))
def test_it_is_periodic(t_s: float) -> None:
    for here, later in zip(motion().state(t_s), motion().state(t_s + 3.0), strict=True):
        np.testing.assert_allclose(here, later, atol=1e-8)


def test_velocity_and_acceleration_are_the_derivatives() -> None:
    h = 1e-4
    t_s = np.linspace(0.0, 6.0, 997)
    before, at, after = (motion().state(t) for t in (t_s - h, t_s, t_s + h))
    np.testing.assert_allclose(at[1], (after[0] - before[0]) / (2.0 * h), atol=1e-5)
    # jerk is bounded, not continuous: at the ends of a move the difference is off by half its step times h
    jerk = 60.0 * 1.2 / 0.8**3
    np.testing.assert_allclose(at[2], (after[1] - before[1]) / (2.0 * h), atol=jerk * h)


def test_acceleration_is_continuous_at_every_knot_and_at_the_seam() -> None:
    eps = 1e-9
    for t_s in (0.0, 0.5, 0.7, 1.1, 1.5, 2.0, 2.5, 2.8, 3.0, 6.0):
        for left, right in zip(motion().state(t_s - eps), motion().state(t_s + eps), strict=True):
            np.testing.assert_allclose(left, right, atol=1e-5)


def test_times_of_any_shape() -> None:
    t_s = np.linspace(0.0, 3.0, 12).reshape(3, 4)
    position, velocity, acceleration = motion().state(t_s)
    assert position.shape == velocity.shape == acceleration.shape == (3, 4, 2)
    np.testing.assert_array_equal(position[1, 2], motion().state(t_s[1, 2])[0])


def test_a_move_may_begin_when_the_one_ahead_ends() -> None:
    MinimumJerkMotion(NAMES, REST, [Move("a", 0.0, 1.0, 1.0), Move("a", 1.0, 1.0, 0.1)], period_s=2.0)


@pytest.mark.parametrize(
    ("moves", "said"),
    [
        ([*THERE_AND_BACK, Move("b", 1.0, 1.0, -0.2)], "b: the move at 1 s begins before"),
        ([*THERE_AND_BACK, Move("b", 2.6, 0.5, -0.2)], "b: its last move ends at 3.1 s"),
        (THERE_AND_BACK, "b: its last move does not return"),
        ([*THERE_AND_BACK, BACK, Move("c", 0.0, 1.0, 0.0)], "a move of c"),
        ([*THERE_AND_BACK, Move("b", 2.5, 0.0, -0.2)], "b: the move at 2.5 s lasts 0 s"),
    ],
)
def test_moves_that_cannot_be_made_are_refused(moves: list[Move], said: str) -> None:
    with pytest.raises(MotionError, match=said):
        MinimumJerkMotion(NAMES, REST, moves, period_s=3.0)
