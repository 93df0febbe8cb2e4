"""What every tracking strategy must do. Call `check` with a function that makes a fresh tracker."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from common.clock import NS_PER_MS
from common.quaternion import Array
from slave.track import Tracker

PERIOD_NS, TICK_NS, TRANSIT_NS = 80 * NS_PER_MS, 5 * NS_PER_MS, 12 * NS_PER_MS
JOINTS = 3
AMPLITUDE_RAD = 0.4

Make = Callable[[], Tracker]


def _operator(at_ns: int) -> tuple[Array, Array]:
    """Position and velocity (J,) of slow sines."""
    rate = 2.0 * np.pi * 0.3
    phase = rate * at_ns / 1e9 + np.arange(JOINTS)
    return AMPLITUDE_RAD * np.sin(phase), AMPLITUDE_RAD * rate * np.cos(phase)


def _follow(tracker: Tracker, seconds: float, move: bool = True) -> Array:
    """(T, J) the targets, one a tick, while the operator moves or stands."""
    targets = []
    for now_ns in range(PERIOD_NS, round(seconds * 1e9), TICK_NS):
        if now_ns % PERIOD_NS == 0:
            sampled_ns = now_ns - TRANSIT_NS
            tracker.accept(sampled_ns, now_ns, *_operator(sampled_ns if move else 0))
        target = tracker.target(now_ns)
        if target is None:
            continue
        assert target.position_rad.shape == target.velocity_rad_s.shape == (JOINTS,)
        assert np.isfinite(target.position_rad).all()
        assert np.isfinite(target.velocity_rad_s).all()
        targets.append(target.position_rad.copy())
    return np.array(targets)


def _no_target_before_the_first_sample(make: Make) -> None:
    assert make().target(PERIOD_NS) is None


def _no_target_after_a_reset(make: Make) -> None:
    tracker = make()
    _follow(tracker, 1.0)
    tracker.reset()
    assert tracker.target(2_000 * NS_PER_MS) is None


def _a_standing_operator_is_reached(make: Make) -> None:
    tracker = make()
    place, rest = np.array([0.1, -0.2, 0.3]), np.zeros(JOINTS)
    for sampled_ns in range(PERIOD_NS, 30 * PERIOD_NS, PERIOD_NS):
        tracker.accept(sampled_ns, sampled_ns + TRANSIT_NS, place, rest)
    target = tracker.target(30 * PERIOD_NS)
    assert target is not None
    assert np.abs(target.position_rad - place).max() < 1e-3


def _a_moving_operator_is_followed(make: Make) -> None:
    targets = _follow(make(), 4.0)
    # more than a quarter of a second of motion behind is no following
    fastest_rad_s = AMPLITUDE_RAD * 2.0 * np.pi * 0.3
    times_ns = range(PERIOD_NS, round(4e9), TICK_NS)[-len(targets) :]
    truth = np.array([_operator(at_ns)[0] for at_ns in times_ns])
    assert np.abs(targets - truth)[200:].max() < 0.25 * fastest_rad_s


def _a_sample_that_is_not_newer_changes_nothing(make: Make) -> None:
    trackers = make(), make()
    for tracker in trackers:
        _follow(tracker, 1.0)
    for sampled_ns in (PERIOD_NS, 960 * NS_PER_MS - TRANSIT_NS):  # the last is the newest one's stamp
        trackers[1].accept(sampled_ns, 1_000 * NS_PER_MS, np.full(JOINTS, 3.0), np.zeros(JOINTS))
    first, second = (tracker.target(1_005 * NS_PER_MS) for tracker in trackers)
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.position_rad, second.position_rad)


def _without_samples_it_comes_to_rest(make: Make) -> None:
    tracker = make()
    _follow(tracker, 2.0)
    late = [tracker.target(at_ns * NS_PER_MS) for at_ns in (6_000, 7_000)]
    assert late[0] is not None
    assert late[1] is not None
    assert np.abs(late[0].position_rad - late[1].position_rad).max() < 1e-6
    assert np.abs(late[1].velocity_rad_s).max() < 1e-6


def _a_sample_is_not_changed_nor_kept(make: Make) -> None:
    tracker = make()
    position, velocity = np.full(JOINTS, 0.3), np.zeros(JOINTS)
    tracker.accept(PERIOD_NS, PERIOD_NS + TRANSIT_NS, position, velocity)
    tracker.target(2 * PERIOD_NS)
    assert (position == 0.3).all()
    position[:] = 9.0
    target = tracker.target(2 * PERIOD_NS + TICK_NS)
    assert target is not None
    assert np.abs(target.position_rad).max() < 1.0


def check(make: Make) -> None:
    """Run every rule, each on a tracker of its own. Fails at the first rule that is broken."""
    _no_target_before_the_first_sample(make)
    _no_target_after_a_reset(make)
    _a_standing_operator_is_reached(make)
    _a_moving_operator_is_followed(make)
    _a_sample_that_is_not_newer_changes_nothing(make)
    _without_samples_it_comes_to_rest(make)
    _a_sample_is_not_changed_nor_kept(make)
