import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slave.track.continuation import Continuation
from slave.track.estimate import Estimate
from slave.track.persistence import LEAST_S, MOST_S

velocities = st.floats(-10.0, 10.0)
accelerations = st.floats(-200.0, 200.0)
times = st.floats(LEAST_S, MOST_S)


def foretold(v: float, a: float, lasts_s: float) -> Continuation:
    return Continuation.of(Estimate(0, np.array([[0.3], [v], [a]]), np.eye(3)), np.array(lasts_s))


@given(velocities, accelerations, times, st.floats(0.001, 0.6))
def test_the_velocity_is_the_slope_of_the_position(v: float, a: float, lasts_s: float, span_s: float) -> None:
    one, h = foretold(v, a, lasts_s), 1e-5
    slope = (one.course(span_s + h)[0] - one.course(span_s - h)[0]) / (2.0 * h)
    assert slope == pytest.approx(one.course(span_s)[1], abs=1e-4, rel=1e-4)


@given(velocities, accelerations, times)
def test_it_begins_with_the_estimate(v: float, a: float, lasts_s: float) -> None:
    np.testing.assert_allclose(foretold(v, a, lasts_s).course(0.0), [[0.3], [v]])


def test_an_even_movement_begins_with_its_acceleration_and_a_restless_one_with_its_velocity_fading() -> None:
    for lasts_s, begins in ((MOST_S, 3.0), (0.1, 3.0 - 2.0 / 0.1)):
        one, h = foretold(2.0, 3.0, lasts_s), 1e-6
        slope = (one.course(h)[1] - one.course(0.0)[1]) / h
        assert slope == pytest.approx(begins, abs=1e-3)


@given(velocities, accelerations, times, st.floats(0.01, 0.6))
def test_nothing_on_the_way_is_farther_than_said(v: float, a: float, lasts_s: float, span_s: float) -> None:
    one = foretold(v, a, lasts_s)
    ways = [float(np.abs(one.way(s))[0]) for s in np.linspace(0.0, span_s, 200).tolist()]
    farthest = float(one.farthest(span_s)[0])
    assert max(ways) <= farthest * (1.0 + 1e-9) + 1e-12
    assert farthest <= 1.001 * max(ways) + 1e-6


@given(velocities, accelerations, times, st.floats(0.0, 1.0))
def test_a_share_of_it_goes_that_share_of_the_way(v: float, a: float, lasts_s: float, share: float) -> None:
    one = foretold(v, a, lasts_s)
    part = one.scaled(np.array([share]))
    np.testing.assert_allclose(part.way(0.2), share * one.way(0.2), atol=1e-12)
    assert part.course(0.0)[0, 0] == 0.3
