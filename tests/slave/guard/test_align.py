"""The start gate and the way back of single joints, at their boundaries."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from deploy.sim.suit.motion import load_motion
from slave.guard import State, align
from slave.guard.align import AlignProgress
from slave.guard.config import GuardConfig
from slave.limit.pace import Pace
from slave.track.config import TrackConfig, make_tracker

MakeRig = Callable[..., Any]
MS = 1_000_000
ALL = np.ones(3, np.bool_)
CONFIG = GuardConfig(align_window_rad=0.05, align_dwell_s=0.2, align_timeout_s=15.0)


@pytest.fixture
def alignment() -> AlignProgress:
    out = AlignProgress(["a", "b", "c"], CONFIG)
    out.begin(0)
    return out


def test_it_is_done_after_the_dwell_time_and_not_before(alignment: AlignProgress) -> None:
    near = np.array([0.05, -0.05, 0.0])
    assert not alignment.done(10 * MS, near, ALL)
    assert not alignment.done(210 * MS - 1, near, ALL)
    assert alignment.done(210 * MS, near, ALL)


@pytest.mark.parametrize("error", [0.0500001, -0.0500001, 3.0, -3.0])
def test_a_joint_outside_on_either_side_is_waited_for(alignment: AlignProgress, error: float) -> None:
    """A start gate without abs() would let a robot start that is far off on one side."""
    for ms in range(0, 1000, 5):
        assert not alignment.done(ms * MS, np.array([0.0, error, 0.0]), ALL)


def test_leaving_the_window_begins_the_dwell_time_anew(alignment: AlignProgress) -> None:
    assert not alignment.done(0, np.zeros(3), ALL)
    assert not alignment.done(150 * MS, np.array([0.0, 0.1, 0.0]), ALL)
    assert not alignment.done(155 * MS, np.zeros(3), ALL)
    assert not alignment.done(350 * MS, np.zeros(3), ALL)
    assert alignment.done(355 * MS, np.zeros(3), ALL)


def test_joints_that_are_not_valid_are_not_waited_for(alignment: AlignProgress) -> None:
    error, valid = np.array([0.0, 9.0, 0.0]), np.array([True, False, True])
    alignment.done(0, error, valid)
    assert alignment.done(200 * MS, error, valid)


def test_with_no_valid_joint_at_all_it_never_is(alignment: AlignProgress) -> None:
    for ms in range(0, 1000, 5):
        assert not alignment.done(ms * MS, np.zeros(3), ~ALL)


def test_it_gives_up_after_its_time_out_and_names_the_farthest_joint(alignment: AlignProgress) -> None:
    alignment.done(0, np.array([0.1, -0.3, 0.2]), ALL)
    assert alignment.overdue(15_000 * MS) is None
    assert alignment.overdue(15_000 * MS + 1) == "not aligned within 15 s: b is 0.30 rad away"


def test_without_the_window_a_robot_that_is_far_off_would_track(
    rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(align, "within", lambda error, window: np.ones(len(error), np.bool_))
    rig.to_align()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.4)
    assert rig.guard.state is State.TRACK


def test_without_abs_a_robot_that_is_far_off_on_one_side_would_track(
    rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(align, "within", lambda error, window: error <= window)
    rig.to_align()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.4)
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize("share", [-0.25, 0.25])
def test_it_comes_slowly_from_either_side_and_tracks_when_near(rig: Any, share: float) -> None:
    rig.to_align()
    rig.target = rig.target + share * (rig.skeleton.upper_rad - rig.skeleton.lower_rad)
    slow = rig.config.align_velocity_rad_s
    gain = rig.config.align_acceleration_rad_s2 * 0.005
    rig.run(0.3)
    assert rig.guard.state is State.ALIGN
    last = rig.setpoints[-1]
    while rig.guard.state is State.ALIGN:
        (setpoint,) = rig.run(0.005)
        speed = np.abs(setpoint.velocity_rad_s)
        assert (speed <= slow + 1e-12).all()
        assert (speed - np.abs(last.velocity_rad_s) <= gain + 1e-12).all()
        last = setpoint
    assert rig.guard.state is State.TRACK
    assert (np.abs(rig.target - last.position_rad) <= rig.config.align_window_rad).all()


def test_an_operator_beyond_the_limits_aligns_at_the_limit(rig: Any) -> None:
    rig.to_align()
    rig.target[6] = rig.skeleton.lower_rad[6] - 0.2
    rig.run(4.0)
    assert rig.guard.state is State.TRACK
    assert rig.measured[6] == pytest.approx(rig.skeleton.lower_rad[6])


def test_an_operator_who_does_not_hold_still_is_not_followed(rig: Any) -> None:
    rig.to_align()
    home = rig.target
    for i in range(200):
        rig.target = home + (0.6 if i % 2 else -0.6) * (rig.skeleton.upper_rad - home)
        rig.run(0.08)
    assert rig.guard.state is State.HOLD
    assert "not aligned within 15 s" in rig.guard.reason
    assert rig.guard.counters.losses == {"align": 1}


SHOULDER, ELBOW = 3, 6


def by_turns(rig: Any, seconds: float) -> list[Any]:
    """Shoulder and elbow move by turns, each faster than `align`, so that one of them is always away."""
    home, steps = rig.home, []
    for _ in range(round(seconds / 0.08)):
        t_s = (rig.now_ns - rig.began_ns) * 1e-9
        turn, inside = divmod(t_s, 0.8)
        way = 0.4 * (1.0 - np.cos(2.0 * np.pi * inside / 0.8))
        rig.target = home.copy()
        rig.target[ELBOW if turn % 2 else SHOULDER] -= way
        steps += rig.run(0.08)
    return steps


def test_an_operator_who_works_is_followed_once_each_joint_was_near(rig: Any) -> None:
    rig.to_leased()
    rig.home, rig.began_ns = rig.target.copy(), rig.now_ns
    rig.engage()
    slow = rig.config.align_velocity_rad_s
    aligning = by_turns(rig, 2.4)
    assert rig.guard.state is State.TRACK
    assert max(np.abs(each.velocity_rad_s).max() for each in aligning[:100]) <= slow + 1e-12
    fast = by_turns(rig, 4.0)
    assert max(abs(each.velocity_rad_s[SHOULDER]) for each in fast) > 1.0


def test_a_joint_that_is_away_when_track_begins_comes_slowly(rig: Any) -> None:
    rig.to_leased()
    rig.target[ELBOW] -= 0.25  # the elbow is late
    rig.engage()
    rig.run(0.4)
    assert rig.guard.state is State.ALIGN
    rig.target[SHOULDER] -= 0.6  # the shoulder has arrived, and the operator goes on
    while rig.guard.state is State.ALIGN:
        rig.run(0.005)
    assert abs(rig.measured[SHOULDER] - rig.target[SHOULDER]) > 0.2, "away when track begins"
    slow = rig.config.align_velocity_rad_s + 1e-12
    assert max(abs(each.velocity_rad_s[SHOULDER]) for each in rig.run(1.5)) <= slow
    rig.target[SHOULDER] += 0.5
    assert max(abs(each.velocity_rad_s[SHOULDER]) for each in rig.run(0.5)) > 1.0, "it is back"


@pytest.mark.parametrize("begins_s", [3.2, 8.0, 11.2])
def test_a_working_operator_half_a_radian_of_joints_away_is_followed_soon(rig: Any, begins_s: float) -> None:
    motion = load_motion("bottle", rig.skeleton)
    rig.pipeline.motion.tracker = make_tracker(TrackConfig())
    posture_rad = motion.state(begins_s)[0]
    rig.measured = np.clip(posture_rad + 0.3, rig.skeleton.lower_rad, rig.skeleton.upper_rad)
    rig.target = posture_rad
    rig.to_align()
    after_s = 0.0
    while rig.guard.state is State.ALIGN:
        rig.target, velocity_rad_s, _ = motion.state(begins_s + after_s)
        for setpoint in rig.run(0.08, velocity_rad_s=velocity_rad_s):
            moving = rig.guard.state is State.ALIGN
            assert (
                not moving or np.abs(setpoint.velocity_rad_s).max() <= rig.config.align_velocity_rad_s + 1e-9
            )
        after_s += 0.08
    assert rig.guard.state is State.TRACK
    assert after_s <= 3.6, "13, 8 and 5 s while all joints had to be near at one time"


# single joints


def lost(rig: Any, *joints: int) -> Any:
    valid = np.ones(rig.joints, np.bool_)
    valid[list(joints)] = False
    return valid


def test_a_joint_that_is_lost_is_held_alone_and_comes_back_slowly(rig: Any) -> None:
    rig.to_track()
    valid = lost(rig, 6)
    start = rig.measured[6]
    rig.target = rig.target + 0.3
    rig.run(1.0, valid=valid)
    assert rig.guard.state is State.TRACK
    assert rig.measured[6] == start
    assert rig.measured[5] == pytest.approx(rig.target[5])

    rig.target = rig.target + 0.4
    back = rig.run(0.5)
    speed = max(abs(s.velocity_rad_s[6]) for s in back)
    assert speed == pytest.approx(rig.config.align_velocity_rad_s)
    assert max(abs(s.velocity_rad_s[5]) for s in back) > 2.0
    rig.run(1.5)
    assert rig.measured[6] == pytest.approx(rig.target[6])

    rig.target = rig.target - 0.7
    again = rig.run(0.5)
    assert max(abs(s.velocity_rad_s[6]) for s in again) > 2.0


def test_a_joint_that_was_lost_while_aligning_comes_back_slowly_too(rig: Any) -> None:
    rig.to_align()
    rig.run(0.1, valid=lost(rig, 6))
    rig.target[6] += 0.8
    rig.run(0.4, valid=lost(rig, 6))
    assert rig.guard.state is State.TRACK
    assert max(abs(s.velocity_rad_s[6]) for s in rig.run(1.0)) <= rig.config.align_velocity_rad_s + 1e-12


def test_a_joint_that_returns_at_the_start_of_track_comes_slowly(rig: Any) -> None:
    rig.to_align()
    rig.target[6] += 0.8
    while rig.guard.state is State.ALIGN:
        rig.run(0.005, valid=lost(rig, 6))
    rig.send()
    fastest = max(abs(rig.step().velocity_rad_s[6]) for _ in range(30))
    assert 0.0 < fastest <= rig.config.align_velocity_rad_s + 1e-12


def leap(rig: Any, rad: float) -> float:
    """The elbow's fastest on its way to a target that jumped so far."""
    rig.to_track()
    rig.target = rig.target.copy()
    rig.target[6] -= rad
    steps = rig.run(4.0)
    assert rig.guard.state is State.TRACK
    assert rig.measured[6] == pytest.approx(rig.target[6])
    return max(float(abs(s.velocity_rad_s[6])) for s in steps)


def test_a_target_that_jumps_beyond_the_window_is_followed_slowly(make_rig: MakeRig) -> None:
    """On either side: a robot that leaps to where a fault says the operator is hurts somebody."""
    for sign in (1.0, -1.0):
        rig = make_rig(GuardConfig(jump_window_rad=0.5))
        assert leap(rig, sign * 0.51) <= rig.config.align_velocity_rad_s + 1e-12
        assert leap(make_rig(GuardConfig(jump_window_rad=0.5)), sign * 0.49) > 1.0


@pytest.mark.parametrize("returning", [False, True])
def test_one_jump_slows_all_joints_a_returning_joint_only_itself(make_rig: MakeRig, returning: bool) -> None:
    rig = make_rig(GuardConfig(jump_window_rad=0.5)).to_track()
    slow = rig.config.align_velocity_rad_s + 1e-12
    rig.target = rig.target.copy()
    rig.target[6] -= 0.6
    if returning:
        rig.run(0.2, valid=lost(rig, 6))
    rig.target[3] -= 0.3
    steps = rig.run(1.0)
    elbow, shoulder = (max(float(abs(s.velocity_rad_s[j])) for s in steps) for j in (6, 3))
    assert elbow <= slow
    assert (shoulder > 1.0) if returning else (shoulder <= slow)


def test_a_joint_that_jumped_regains_full_speed_once_there(make_rig: MakeRig) -> None:
    rig = make_rig(GuardConfig(jump_window_rad=0.5))
    leap(rig, 0.6)
    rig.target[6] += 0.4
    assert max(abs(s.velocity_rad_s[6]) for s in rig.run(0.5)) > 1.0


def test_flickering_validity_never_makes_a_joint_lurch(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.target + 0.4
    for i in range(30):
        steps = rig.run(0.08, valid=lost(rig, 6) if i % 2 == 0 else np.ones(rig.joints, np.bool_))
        assert max(abs(s.velocity_rad_s[6]) for s in steps) <= rig.config.align_velocity_rad_s + 1e-12
    rig.run(2.0)
    assert rig.measured[6] == pytest.approx(rig.target[6])


def test_all_nodes_lost_stops_every_joint_before_the_robot_holds(rig: Any) -> None:
    rig.to_track()
    rig.run(0.1, valid=np.zeros(rig.joints, np.bool_))
    assert rig.guard.state is State.TRACK
    rig.run(0.2, valid=np.zeros(rig.joints, np.bool_))
    assert rig.guard.state is State.HOLD
    assert rig.pipeline.motion.limiter.at_rest


@pytest.mark.parametrize("strategy", ["latest", "interpolate", "predict"])
def test_a_target_that_sweeps_past_a_held_joint_does_not_let_it_go(rig: Any, strategy: str) -> None:
    # the master says 0 of a lost joint: on return the target comes from there, past where it is held
    rig.pipeline.motion.tracker = make_tracker(TrackConfig.model_validate({"strategy": strategy}))
    rig.target[6] = 0.4
    rig.measured = rig.measured.copy()
    rig.measured[6] = 0.4
    rig.to_align()
    rig.run(1.0)
    assert rig.guard.state is State.TRACK
    unknown = rig.target.copy()
    unknown[6] = 0.0
    rig.run(0.5, valid=lost(rig, 6), position_rad=unknown)
    rig.target[6] = 1.2
    back = rig.run(1.0)
    assert max(abs(s.velocity_rad_s[6]) for s in back) <= rig.config.align_velocity_rad_s + 1e-12


def test_without_pace_it_would_come_back_at_full_speed(rig: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Pace, *_: Any) -> Any:
        return self._limits.max_velocity_rad_s, self._limits.max_acceleration_rad_s2

    monkeypatch.setattr(Pace, "tracking", full)
    rig.to_track()
    rig.target = rig.target + 0.7
    rig.run(1.0, valid=lost(rig, 6))
    assert max(abs(s.velocity_rad_s[6]) for s in rig.run(0.5)) > 2.0
