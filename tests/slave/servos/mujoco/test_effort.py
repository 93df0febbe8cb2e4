"""The torque that is told is the one that moved the robot, by the robot's own equation of motion."""

import mujoco
import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.model.build import build_model, unit_rates
from slave.servos.mujoco.effort import MotorTorque
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot


@pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
def test_the_torque_told_is_what_the_motion_took(profile: str) -> None:
    skeleton = load_skeleton(profile)
    model = build_model(skeleton)
    data = mujoco.MjData(model)
    rates, torque = unit_rates(skeleton, model), MotorTorque(skeleton, model, data)
    middle, span = 0.5 * (skeleton.lower_rad + skeleton.upper_rad), skeleton.upper_rad - skeleton.lower_rad
    data.qpos[:] = middle @ rates
    by_motor = model.jnt_actgravcomp.astype(bool)[model.dof_jntid]
    seen, off = [], []
    # flung so far that motors reach their limits
    for k in range(500):
        data.ctrl[:] = middle + 0.3 * span * np.sin(2 * np.pi * 0.5 * k * 0.004 + np.arange(len(middle)))
        before = data.qvel.copy()
        torque.before()
        mujoco.mj_step(model, data)
        torque.after()
        inertial = np.empty(model.nv)
        mujoco.mj_mulM(model, data, inertial, (data.qvel - before) / model.opt.timestep)
        others = data.qfrc_passive - np.where(by_motor, 0.0, data.qfrc_gravcomp) + data.qfrc_constraint
        seen.append(rates @ (inertial + data.qfrc_bias - others))
        off.append(torque.joint_nm - seen[-1])
    assert (np.std(seen, axis=0) > 1e-4).all()
    assert (np.abs(off).max(axis=0) < 1e-6 * np.abs(seen).max(axis=0)).all()


def test_a_reading_carries_the_gravity_that_the_motors_hold() -> None:
    skeleton = load_skeleton("nursing")
    robot = SimulatedRobot(
        skeleton, position_rad=np.clip(np.zeros(25), skeleton.lower_rad, skeleton.upper_rad)
    )
    assert robot.read().effort_nm is not None
    outstretched = robot.position_rad.copy()
    outstretched[skeleton.joint_names.index("left_shoulder_roll")] = np.pi / 2
    robot.write(outstretched)
    for _ in range(1000):
        robot.advance(robot.now_ns + CYCLE_NS)
    effort = robot.read().effort_nm
    assert effort is not None
    held = dict(zip(skeleton.joint_names, np.abs(effort), strict=True))
    # an arm stretched out sideways, by the model's own masses; the other one hangs
    assert 5.0 < held["left_shoulder_roll"] < 40.0
    assert held["right_shoulder_roll"] < 0.2 * held["left_shoulder_roll"]


def test_a_simulation_that_has_diverged_tells_no_effort() -> None:
    robot = SimulatedRobot(load_skeleton("hand"))
    robot._hinge_rad[3] = np.nan
    assert robot.read().effort_nm is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motor_gives_no_more_than_it_is_allowed(sign: float) -> None:
    skeleton = load_skeleton("nursing")
    rest = np.clip(np.zeros(25), skeleton.lower_rad, skeleton.upper_rad)
    for joint in (name for name in skeleton.joint_names if "thumb" not in name):
        j = skeleton.joint_names.index(joint)
        robot = SimulatedRobot(skeleton, position_rad=rest)
        robot.write(rest + sign * 0.3 * np.eye(25)[j])
        own = np.abs(_steps(robot, 3)[:, j]).max()
        allowed = np.stack([np.full(25, -np.inf), np.full(25, np.inf)])
        allowed[int(sign > 0), j] = sign * 0.5 * own
        robot = SimulatedRobot(skeleton, position_rad=rest)
        robot.write(rest + sign * 0.3 * np.eye(25)[j])
        robot.limit_torque(allowed)
        told = sign * _steps(robot, 3)[1:, j]
        room = sign * (skeleton.upper_rad[j] if sign > 0 else skeleton.lower_rad[j])
        if room < 0.05:
            continue  # it cannot go that way
        assert told.max() == pytest.approx(0.5 * own, rel=1e-3), joint
        robot.limit_torque(None)
        assert sign * _steps(robot, 2)[1:, j].max() > 0.0


def test_a_limit_that_is_wider_than_the_motor_changes_nothing() -> None:
    skeleton = load_skeleton("nursing")
    rest = np.clip(np.zeros(25), skeleton.lower_rad, skeleton.upper_rad)
    efforts = []
    for wide in (None, np.array([[-1e4] * 25, [1e4] * 25])):
        robot = SimulatedRobot(skeleton, position_rad=rest)
        robot.limit_torque(wide)
        robot.write(rest + 0.5)
        efforts.append(_steps(robot, 40))
    assert efforts[0] == pytest.approx(efforts[1])


@pytest.mark.parametrize(
    "torque", [np.zeros((2, 3)), np.stack([np.ones(25), np.zeros(25)]), np.full((2, 25), np.nan)]
)
def test_torque_limits_that_are_no_ranges_are_refused(torque: Array) -> None:
    with pytest.raises(ValueError, match="torque limits must be 25 ranges"):
        SimulatedRobot(load_skeleton("nursing")).limit_torque(torque)


def _steps(robot: SimulatedRobot, cycles: int) -> Array:
    out = []
    for _ in range(cycles):
        robot.advance(robot.now_ns + CYCLE_NS)
        out.append(robot.effort_nm.copy())
    return np.array(out)
