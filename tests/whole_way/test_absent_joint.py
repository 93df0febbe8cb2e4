"""A joint without a servo: the robot follows with all others, and its angle is told as not measured."""

from __future__ import annotations

import numpy as np

from deploy.sim.world.world import WorldSettings
from tests.whole_way.runs import engaged

SLAVE = ['servos={joints={mujoco=["[!w]*"], absent=["waist_pitch"]}}']


def test_a_robot_without_a_waist_drive_follows_with_its_arms() -> None:
    run = engaged(WorldSettings(overrides={"slave": SLAVE}))
    names = run.slave_config.skeleton.joint_names
    waist = names.index("waist_pitch")
    stood = run.states[-1].setpoint_rad[waist]
    first = len(run.states)
    run.run(8.0)
    assert run.slave.guard.state == "track", run.slave.guard.reason
    asked = np.array([command.position_rad for command in run.commands[-100:]])
    assert np.ptp(asked[:, waist]) > 0.1, "the operator's waist moved"
    seen = run.states[first:]
    assert all(state.setpoint_rad[waist] == stood for state in seen)
    assert not any(state.encoder_valid[waist] for state in seen)
    assert all(state.encoder_valid.sum() == len(names) - 1 for state in seen)
    off = np.abs(run.states[-1].setpoint_rad - run.commands[-1].position_rad)
    off[waist] = 0.0
    assert off.max() < 0.1
