"""The zero pose taken again while the robot follows: it holds, and moves only after somebody has engaged."""

from __future__ import annotations

import numpy as np

from common.skeleton import load_skeleton
from common.wire.messages import Action
from deploy.harness.faults.setting import Setting, files
from deploy.sim.suit.motion import parse_motion
from deploy.sim.world.world import VirtualWorld, WorldSettings

REACH_THEN_STAND = """
period_s = 60.0
[rest_deg]
neck_yaw = 0.0
[[move]]
start_s = 6.0
duration_s = 1.5
to_deg = { right_elbow_pitch = 60.0, neck_yaw = 20.0 }
[[move]]
start_s = 12.0
duration_s = 1.5
to_deg = { right_elbow_pitch = 0.0, neck_yaw = 0.0 }
"""
WORN = Setting(
    aligned=True, master=("estimation.zero_pose_s=1.0", "operator.zero_pose_again.countdown_s=3.0")
)


def test_the_robot_holds_from_asking_until_somebody_engages() -> None:
    motion = parse_motion(REACH_THEN_STAND, load_skeleton("nursing"), source="reach")
    with files(WORN) as master:
        run = VirtualWorld(WorldSettings(motion=motion, overrides={"master": master}))
    run.engage()
    run.run(10.0 - run.now_ns * 1e-9)
    elbow = run.slave_config.skeleton.joint_names.index("right_elbow_pitch")
    assert run.states[-1].position_rad[elbow] > 0.9, "the robot follows a bent elbow"

    run.take_zero_pose_again()
    run.run(0.6)
    assert run.slave.guard.state == "hold"
    assert run.slave.guard.reason.endswith("the operator takes the zero pose again")
    held = run.states[-1].setpoint_rad
    run.run(3.5)  # the operator lets the arms hang, too late for the countdown: the pose waits for him
    refused = run.ask(Action.ENGAGE)
    assert not refused.done
    assert "the operator takes the zero pose again" in refused.text
    run.run(4.0)
    assert [line.partition(":")[0] for line in run.said] == [
        "zero pose again (a key)", "zero pose in 2 s", "zero pose in 1 s", "zero pose", run.said[-1],
    ]  # fmt: skip
    assert run.said[-1] == "zero pose taken; engage when you are ready"
    run.run(2.0)
    assert run.slave.guard.state == "hold"
    assert (run.states[-1].setpoint_rad == held).all(), "it has not moved by itself"
    assert run.ask(Action.ENGAGE).done
    run.run(4.0, until=lambda: run.slave.guard.state == "track")
    assert run.slave.guard.state == "track"
    assert np.abs(run.states[-1].setpoint_rad[elbow]) < 0.1
