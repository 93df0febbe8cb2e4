"""The guard as a whole: boot, hold, and what an operator's sudden motion does to the robot."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.wire.messages import Action
from slave.guard import GuardConfig, State
from slave.guard.events import Change, Clamp, Rule
from slave.track import TrackTarget

MakeRig = Callable[..., Any]


def test_boot_waits_for_every_encoder_and_writes_nothing(rig: Any) -> None:
    rig.encoder_valid[11] = False
    for _ in range(100):
        setpoint = rig.step()
        assert not setpoint.ready
        assert np.array_equal(setpoint.position_rad, rig.measured)
    assert rig.guard.state is State.BOOT
    rig.encoder_valid[11] = True
    setpoint = rig.step()
    assert setpoint.ready
    assert rig.guard.state is State.HOLD
    assert np.array_equal(setpoint.position_rad, rig.measured)


def test_boot_does_not_take_an_old_reading_for_a_posture(rig: Any) -> None:
    rig.encoder_delay_ns = 50_000_001
    rig.step()
    assert rig.guard.state is State.BOOT
    rig.encoder_delay_ns = 50_000_000
    rig.step()
    assert rig.guard.state is State.HOLD


def test_a_joint_that_boots_beyond_its_limit_does_not_jump(rig: Any) -> None:
    rig.measured = rig.measured.copy()
    rig.measured[6] = rig.skeleton.lower_rad[6] - 0.02
    rig.to_align()
    rig.run(4.0)
    assert rig.guard.state is State.TRACK
    assert rig.setpoints[0].position_rad[6] == rig.skeleton.lower_rad[6] - 0.02
    moved = np.diff([s.position_rad[6] for s in rig.setpoints])
    assert np.abs(moved).max() <= rig.config.align_velocity_rad_s * 0.005 + 1e-12


def test_hold_does_not_follow_a_robot_that_sags(rig: Any) -> None:
    rig.to_leased()
    rig.coupled = False
    held = rig.setpoints[-1].position_rad
    for _ in range(100):
        rig.measured = rig.measured - 0.001
        assert np.array_equal(rig.step().position_rad, held)


def test_nothing_moves_before_engage_whatever_the_operator_does(rig: Any) -> None:
    rig.to_leased()
    held = rig.measured
    rng = np.random.default_rng(1)
    for _ in range(30):
        rig.target = rng.uniform(rig.skeleton.lower_rad, rig.skeleton.upper_rad)
        rig.run(0.08)
    assert np.array_equal(rig.measured, held)


def test_align_begins_at_the_held_setpoint_at_rest(rig: Any) -> None:
    rig.to_leased()
    rig.target = rig.skeleton.upper_rad.copy()
    held = rig.setpoints[-1].position_rad
    rig.engage()
    first = rig.run(0.005)[0]
    assert np.abs(first.position_rad - held).max() <= rig.config.align_acceleration_rad_s2 * 0.005**2 + 1e-12


def test_what_came_before_engage_does_not_move_it_after(rig: Any) -> None:
    rig.to_leased()
    rig.engage()
    held = rig.measured
    for _ in range(10):
        rig.step()
        assert rig.tracker.newest is None
    assert np.array_equal(rig.measured, held)


def test_a_command_between_the_engage_and_the_next_tick_is_kept(rig: Any) -> None:
    rig.to_leased()
    rig.engage()
    assert rig.send().accepted
    rig.step()
    assert rig.tracker.newest is not None


@pytest.mark.parametrize("jump", [0.2, 0.5, -0.5, 5.0])
def test_a_sudden_motion_cannot_make_it_jump(rig: Any, jump: float) -> None:
    rig.to_track()
    rig.target = rig.target + jump
    last = rig.setpoints[-1]
    for setpoint in rig.run(1.0):
        assert (np.abs(setpoint.velocity_rad_s) <= rig.skeleton.max_velocity_rad_s + 1e-9).all()
        gain = np.abs(setpoint.velocity_rad_s - last.velocity_rad_s)
        assert (gain <= rig.skeleton.max_acceleration_rad_s2 * 0.005 + 1e-9).all()
        last = setpoint
    reachable = np.clip(rig.target, rig.skeleton.lower_rad, rig.skeleton.upper_rad)
    assert np.allclose(rig.measured, reachable, rtol=0, atol=1e-9)


def test_a_late_step_moves_the_setpoint_no_further_than_its_cap(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    before = rig.setpoints[-1]
    rig.send()
    after = rig.step(150_000_000)
    assert rig.guard.counters.late_steps == 1
    most = rig.skeleton.max_velocity_rad_s * rig.config.max_step_s
    assert (np.abs(after.position_rad - before.position_rad) <= most + 1e-12).all()


@pytest.mark.parametrize("dt_ns", [0, -1, -5_000_000])
def test_a_step_in_no_time_or_less_moves_nothing(rig: Any, dt_ns: int) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    before = rig.setpoints[-1]
    assert np.array_equal(rig.step(dt_ns).position_rad, before.position_rad)
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("field", ["position_rad", "velocity_rad_s"])
def test_a_tracker_that_fails_holds(rig: Any, bad: float, field: str) -> None:
    rig.to_track()
    values = {"position_rad": rig.target.copy(), "velocity_rad_s": np.zeros(rig.joints)}
    values[field][9] = bad
    rig.tracker.override = TrackTarget(**values)
    setpoint = rig.step()
    assert rig.guard.state is State.HOLD
    assert np.isfinite(setpoint.position_rad).all()
    assert rig.guard.counters.losses == {"target": 1}


def test_the_tracker_is_told_times_on_the_slaves_clock(rig: Any) -> None:
    rig.to_track()
    rig.send(sampled_ns=rig.now_ns - 30_000_000)
    sampled_ns, now_ns, position, velocity = rig.tracker.accepted[-1]
    assert (sampled_ns, now_ns) == (rig.now_ns - 30_000_000, rig.now_ns)
    assert np.array_equal(position, rig.target)
    assert np.array_equal(velocity, np.zeros(rig.joints))


def test_the_tracker_forgets_at_every_change_but_into_track(rig: Any) -> None:
    rig.to_align()
    rig.step()
    resets = rig.tracker.resets
    rig.run(0.4)
    assert rig.guard.state is State.TRACK
    assert rig.tracker.resets == resets
    rig.ask(Action.DISENGAGE)
    rig.step()
    assert rig.tracker.resets == resets + 1


def test_a_caller_that_changes_its_arrays_later_changes_nothing(rig: Any) -> None:
    rig.to_track()
    valid = np.ones(rig.joints, np.bool_)
    rig.send(valid=valid)
    valid[:] = False
    rig.measured += 0.0
    before = rig.step()
    rig.target[:] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        before.position_rad[0] = 1.0
    assert rig.guard._commands.valid.all()


def test_changes_and_clamps_are_remembered_and_counted(rig: Any) -> None:
    rig.to_track()
    rig.target[6] = rig.skeleton.upper_rad[6] + 1.0
    rig.run(1.0)
    rig.run(0.3, commands=False)
    events = list(rig.guard.events)
    changes = [(e.before, e.after) for e in events if isinstance(e, Change)]
    assert changes == [("boot", "hold"), ("hold", "align"), ("align", "track"), ("track", "hold")]
    clamps = {(e.joint, e.rule): e for e in events if isinstance(e, Clamp)}
    position = clamps["left_elbow_pitch", Rule.POSITION]
    assert (position.asked, position.given) == pytest.approx((rig.target[6], rig.skeleton.upper_rad[6]))
    counted = rig.guard.counters.metrics("hold", "")
    assert counted.clamps == {"position": 1, "velocity": 1, "acceleration": 1}
    assert counted.losses == {"command": 1}
    assert counted.received == counted.accepted
    assert all(type(key) is str for key in counted.clamps)


def test_only_the_newest_events_are_kept(make_rig: MakeRig) -> None:
    rig = make_rig(GuardConfig(events_kept=5)).to_track()
    for i in range(10):
        rig.target = rig.target + (0.3 if i % 2 else -0.3)
        rig.run(0.3)
    assert len(rig.guard.events) == 5
    assert sum(rig.guard.counters.clamps.values()) > 100
