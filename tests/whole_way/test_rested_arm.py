"""An arm that rests does not move at its encoders while the operator's does; taken up, it does not jump."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton.groups import joint_groups
from common.wire.messages import Action
from deploy.sim.world.world import WorldSettings
from tests.whole_way.runs import engaged

COUNT_RAD = 2.0 * math.pi / 4096


def test_the_encoders_of_a_rested_arm_stand_still_and_come_back_slowly() -> None:
    run = engaged(WorldSettings())
    arm = joint_groups(run.slave_config.skeleton)["left_arm"]
    speeds: list[Array] = []
    run.inject.watch = lambda _, setpoint: speeds.append(np.abs(setpoint.velocity_rad_s))
    run.run(2.0)
    assert run.ask(Action.REST, groups=("left_arm",)).done
    run.run(1.0)  # brakes
    first = len(run.states)
    run.run(8.0)
    seen: NDArray[np.float64] = np.array([state.position_rad for state in run.states[first:]])
    turned = np.ptp(seen, axis=0)
    operator = np.ptp([command.position_rad for command in run.commands[-100:]], axis=0)
    assert operator[arm].max() > 0.3, "the operator's arm moved"
    assert turned[arm].max() <= 2.0 * COUNT_RAD, "two counts: a light joint shakes with the trunk"
    assert turned[~arm].max() > 0.3, "the rest of the robot follows"
    assert run.states[-1].resting == ("left_arm",)

    assert run.ask(Action.TAKE_UP, groups=("left_arm",)).done
    begin = len(speeds)
    run.run(1.0)
    most = run.slave_config.guard.align_velocity_rad_s
    assert max(speed[arm].max() for speed in speeds[begin:]) <= most + 1e-9
    run.run(5.0)
    assert run.states[-1].resting == ()
    off = np.abs(run.states[-1].setpoint_rad - run.commands[-1].position_rad)
    assert off[arm].max() < 0.05, "it follows again"
