import numpy as np
import pytest

from slave.track.interpolate import Interpolate

from .samples import MS, PERIOD, TRANSIT, course, feed

MARGIN = 10
DELAY_S = (PERIOD + TRANSIT + MARGIN) / 1e3


def fresh() -> Interpolate:
    return Interpolate(0.08, MARGIN / 1e3)


def test_a_reset_forgets_the_difference_being_worked_off() -> None:
    tracker = fresh()
    for k in range(4):
        feed(tracker, k, float(k), 0.0)
    tracker.reset()
    tracker.accept(3 * PERIOD * MS, (3 * PERIOD + TRANSIT) * MS, np.full(1, 7.0), np.zeros(1))
    assert course(tracker, 3 * PERIOD + TRANSIT + 1)[0] == 7.0


def test_the_first_sample_is_where_it_stands() -> None:
    tracker = fresh()
    feed(tracker, 0, 1.0, 3.0)
    for ms in (12.0, 50.0, 91.0):
        position, velocity = course(tracker, ms)
        assert position == 1.0
        assert velocity == 0.0


def test_a_cubic_comes_out_exactly_one_period_transit_and_margin_late() -> None:
    cubic = np.polynomial.Polynomial([0.1, -1.0, 4.0, 2.5])
    tracker = fresh()
    for k in range(12):
        feed(tracker, k, cubic(PERIOD * k / 1e3), cubic.deriv()(PERIOD * k / 1e3))
        if k < 4:
            continue  # the first blend, from standing, is still being worked off
        for ms in np.arange(PERIOD * k + TRANSIT, PERIOD * (k + 1) + TRANSIT, 3.0).tolist():
            position, velocity = course(tracker, ms)
            assert position == pytest.approx(cubic(ms / 1e3 - DELAY_S), abs=1e-9)
            assert velocity == pytest.approx(cubic.deriv()(ms / 1e3 - DELAY_S), abs=1e-8)
    assert tracker.delay_s == pytest.approx(DELAY_S)


def test_no_sample_makes_position_or_velocity_jump_whenever_it_comes() -> None:
    rng = np.random.default_rng(3)
    tracker = fresh()
    for k in range(60):
        transit = int(rng.integers(1, 75))
        at_ms = PERIOD * k + transit
        before = tracker.target(at_ms * MS)
        feed(tracker, k, float(rng.normal()), float(rng.normal(0.0, 3.0)), transit)
        if before is not None:
            position, velocity = course(tracker, at_ms)
            np.testing.assert_allclose(position, before.position_rad, atol=1e-9)
            np.testing.assert_allclose(velocity, before.velocity_rad_s, atol=1e-8)


def test_with_no_sample_ahead_it_slows_smoothly_to_rest() -> None:
    tracker = fresh()
    for k in range(8):
        feed(tracker, k, PERIOD * k / 1e3, 1.0)
    ran_out_ms = 7 * PERIOD + 1e3 * DELAY_S
    assert course(tracker, ran_out_ms)[1] == pytest.approx(1.0)
    assert 0.0 < course(tracker, ran_out_ms + 40.0)[1] < 1.0
    position, velocity = course(tracker, ran_out_ms + 80.0)
    assert velocity == pytest.approx(0.0, abs=1e-9)
    assert position == pytest.approx(7 * PERIOD / 1e3 + 0.04)
    assert course(tracker, 60_000.0)[0] == pytest.approx(position)


def test_the_delay_follows_a_slower_link_and_ignores_a_lost_sample() -> None:
    tracker = fresh()
    for k in range(6):
        feed(tracker, k, 0.0, 0.0)
    feed(tracker, 7, 0.0, 0.0)
    assert tracker.delay_s < DELAY_S + 0.1 * 0.5 * 0.092 + 1e-9
    for k in range(8, 250):
        feed(tracker, k, 0.0, 0.0, transit=60)
    assert tracker.delay_s == pytest.approx(0.15, abs=1e-3)


def test_when_a_slow_link_becomes_fast_the_played_segment_stays() -> None:
    tracker = fresh()
    for k in range(40):
        feed(tracker, k, PERIOD * k / 1e3, 1.0, transit=230)
    for k, at_ms in ((40, 3351), (41, 3352), (42, 3365)):
        tracker.accept(PERIOD * k * MS, at_ms * MS, np.array([PERIOD * k / 1e3]), np.ones(1))
    late_ms = 3365.0 + 79.0
    assert course(tracker, late_ms)[0] == pytest.approx(late_ms / 1e3 - tracker.delay_s, abs=1e-3)
