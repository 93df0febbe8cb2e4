"""What the robot's motion forgets at a stop, and what it tells of."""

from __future__ import annotations

from typing import Any

import numpy as np

from common.wire.messages import Action
from slave.guard.states import State

from .conftest import KEY

SHOULDER = 3


def moving(rig: Any) -> Any:
    """It follows an operator, and is under way."""
    rig.to_track()
    rig.target = rig.measured + 0.4 * np.eye(rig.joints)[SHOULDER]
    rig.run(0.1)
    assert abs(rig.setpoints[-1].velocity_rad_s[SHOULDER]) > 0.1
    return rig


def test_after_a_stop_tracker_and_nearest_posture_begin_anew(rig: Any) -> None:
    moving(rig)
    forgotten: list[bool] = []
    rig.pipeline.motion.nearest.forget = lambda: forgotten.append(True)
    resets = rig.tracker.resets
    rig.guard.disengage(rig.now_ns, "enough")
    rig.step()
    assert (rig.tracker.resets, forgotten) == (resets + 1, [True])
    assert rig.tracker.newest is None
    assert rig.pipeline.motion.target is None
    rig.step()
    assert (rig.tracker.resets, forgotten) == (resets + 1, [True])


def test_a_command_right_after_a_stop_is_not_forgotten_with_those_before_it(rig: Any) -> None:
    moving(rig)
    rig.guard.disengage(rig.now_ns, "enough")
    assert rig.send().accepted
    rig.step()
    assert rig.tracker.newest is not None


def test_held_drives_have_all_their_torque_and_after_it_no_older_motions_limit(rig: Any) -> None:
    moving(rig)
    assert rig.setpoints[-1].torque_nm is not None
    rig.guard.disengage(rig.now_ns, "enough")
    held = rig.run(1.0)
    assert all(setpoint.torque_nm is None for setpoint in held)
    rig.target = rig.measured.copy()
    rig.run(0.2)
    rig.engage()
    first, *_, last = (one.torque_nm for one in rig.run(0.2) if one.torque_nm is not None)
    np.testing.assert_allclose(first, last, rtol=1e-3, atol=1e-3)


def test_a_robot_that_was_moved_by_hand_is_not_foretold_to_leap_there(rig: Any) -> None:
    rig.to(State.ESTOP)
    rig.coupled = False
    rig.run(0.2)
    rig.measured = rig.measured + 0.5 * np.eye(rig.joints)[SHOULDER]
    rig.run(0.2)
    assert rig.ask(Action.RESET, key=KEY).done
    rig.step()
    assert rig.setpoints[-1].position_rad[SHOULDER] == rig.measured[SHOULDER]
    assert rig.pipeline.contact._foretold.sudden_nm.max() < 0.01


def test_the_joints_that_a_limit_held_back_are_told_once(rig: Any) -> None:
    rig.to_track()
    rig.target[SHOULDER] = rig.skeleton.upper_rad[SHOULDER] + 0.2
    rig.run(0.3)
    assert np.flatnonzero(rig.pipeline.motion.take_clamped()).tolist() == [SHOULDER]
    assert not rig.pipeline.motion.take_clamped().any()
