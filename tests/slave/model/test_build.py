"""The MuJoCo robot against the table it is built from, and its servos against what they should do."""

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from common.quaternion import Array, angle_between
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations, origins
from slave.model.build import STEP_S, build_model, unit_rates
from slave.model.own import leader

SKELETON = load_skeleton("nursing")
MODEL = build_model(SKELETON)
RATES = unit_rates(SKELETON, MODEL)
LEADERS: NDArray[np.intp] = np.array([MODEL.joint(leader(j)[0]).qposadr[0] for j in SKELETON.joints])
J = len(SKELETON.joints)
MIDDLE = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad)
NEUTRAL = np.clip(np.zeros(J), SKELETON.lower_rad, SKELETON.upper_rad)
HIGH = MIDDLE + 0.3 * (SKELETON.upper_rad - SKELETON.lower_rad)
FINGERS = ("thumb", "index", "middle", "ring", "little")
POSTURES = pytest.mark.parametrize("posture", [MIDDLE, NEUTRAL, HIGH], ids=["middle", "neutral", "high"])


def settled(posture: Array) -> mujoco.MjData:
    data = mujoco.MjData(MODEL)
    data.qpos[:] = posture @ RATES
    data.ctrl[:] = posture
    mujoco.mj_step(MODEL, data, nstep=round(1.0 / STEP_S))
    return data


def steps(data: mujoco.MjData, seconds: float) -> Iterator[float]:
    for k in range(round(seconds / STEP_S)):
        yield k * STEP_S
        mujoco.mj_step(MODEL, data)


def test_actuators_are_the_joints_in_order_with_the_table_s_limits() -> None:
    assert tuple(MODEL.actuator(j).name for j in range(MODEL.nu)) == SKELETON.joint_names
    np.testing.assert_allclose(MODEL.actuator_ctrlrange[:, 0], SKELETON.lower_rad)
    np.testing.assert_allclose(MODEL.actuator_ctrlrange[:, 1], SKELETON.upper_rad)


def test_every_named_angle_is_a_hinge_on_its_segment_about_its_axis() -> None:
    assert {MODEL.joint(k).name for k in range(MODEL.njnt)} == set(SKELETON.angle_slots)
    for angle, (segment, place) in SKELETON.angle_slots.items():
        hinge = MODEL.joint(angle)
        assert MODEL.body(int(hinge.bodyid[0])).name == SKELETON.segment_names[segment]
        np.testing.assert_array_equal(hinge.axis, SKELETON.segments[segment].axes[place])


def test_mechanical_stops_stand_three_degrees_outside_the_limits() -> None:
    for joint in SKELETON.joints:
        angle, ratio = leader(joint)
        stops = np.array([joint.lower_rad, joint.upper_rad]) * ratio + np.deg2rad([-3.0, 3.0])
        np.testing.assert_allclose(MODEL.joint(angle).range, stops)


def test_forward_kinematics_are_those_of_the_table() -> None:
    rng = np.random.default_rng(1)
    data = mujoco.MjData(MODEL)
    bodies = [MODEL.body(name).id for name in SKELETON.segment_names]
    for _ in range(40):
        position = rng.uniform(SKELETON.lower_rad, SKELETON.upper_rad)
        data.qpos[:] = position @ RATES
        mujoco.mj_kinematics(MODEL, data)
        q = orientations(SKELETON, position)
        assert angle_between(data.xquat[bodies], q).max() < 1e-7
        np.testing.assert_allclose(data.xpos[bodies], origins(SKELETON, q), atol=1e-12)


def test_the_head_looks_ahead_with_the_image_upright() -> None:
    data = mujoco.MjData(MODEL)
    mujoco.mj_forward(MODEL, data)
    right, up, back = data.camera("head").xmat.reshape(3, 3).T
    np.testing.assert_allclose([right, up, back], [[0, -1, 0], [0, 0, 1], [-1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(data.site("head").xpos, data.camera("head").xpos)


@POSTURES
def test_gravity_makes_no_joint_sag_by_a_third_of_a_degree(posture: Array) -> None:
    assert np.rad2deg(np.abs(settled(posture).qpos[LEADERS] - posture)).max() < 0.3


@POSTURES
def test_every_servo_lags_a_ramp_by_28_ms(posture: Array) -> None:
    # 2 ζ / ω of 8 Hz damped by √½, whatever the load; away from the nearer limit
    direction = np.where(posture > MIDDLE, -1.0, 1.0)
    speed = np.deg2rad(40.0) * direction
    for j in range(15):
        data, rest = settled(posture), posture[j]
        began = data.qpos[LEADERS[j]]
        for t in steps(data, 0.3):
            data.ctrl[j] = rest + speed[j] * t
        lag_s = 0.3 - (data.qpos[LEADERS[j]] - began) / speed[j]
        assert lag_s == pytest.approx(0.0281, abs=0.001), SKELETON.joint_names[j]


@POSTURES
def test_a_step_is_answered_within_40_ms_with_little_overshoot(posture: Array) -> None:
    for j in range(16):
        data = settled(posture)
        began = data.qpos[LEADERS[j]]
        step = np.deg2rad(2.0) * (-1.0 if posture[j] > MIDDLE[j] else 1.0)
        data.ctrl[j] += step
        answer = []
        for _ in steps(data, 0.6):
            answer.append((data.qpos[LEADERS[j]] - began) / step)
        name = SKELETON.joint_names[j]
        assert 0.018 <= STEP_S * np.argmax(np.array(answer) > 0.5) <= 0.04, name
        assert max(answer) < 1.1, name
        assert answer[-1] == pytest.approx(1.0, abs=0.01), name


def test_torques_reach_their_limits_and_never_pass_them() -> None:
    data = settled(NEUTRAL)
    data.ctrl[:] = np.clip(NEUTRAL + 0.6, SKELETON.lower_rad, SKELETON.upper_rad)
    hinges = MODEL.actuator_trnid[:, 0]
    limit = MODEL.jnt_actfrcrange[hinges, 1]
    greatest = np.zeros(J)
    for _ in steps(data, 0.1):
        greatest = np.maximum(greatest, np.abs(data.qfrc_actuator[MODEL.jnt_dofadr[hinges]]))
    assert (greatest <= limit * (1.0 + 1e-9)).all()
    assert np.count_nonzero(greatest > 0.999 * limit) > 10


def test_torque_limits_leave_room_for_the_tables_accelerations() -> None:
    hinges = MODEL.actuator_trnid[:, 0]
    limit = MODEL.jnt_actfrcrange[hinges, 1]
    for j in range(15):
        data = settled(MIDDLE)
        for t in steps(data, 0.08):
            data.ctrl[j] = MIDDLE[j] + 0.5 * SKELETON.max_acceleration_rad_s2[j] * t**2
            torque = data.qfrc_actuator[MODEL.jnt_dofadr[hinges]]
            assert (np.abs(torque) < limit).all(), SKELETON.joint_names[j]


def test_torque_limits_leave_room_for_what_the_other_joints_do_to_one() -> None:
    """All others speed up as fast as they may, with the signs that add up: a wrist was thrown by its arm.

    The joint itself stands.
    """
    hinges = MODEL.actuator_trnid[:, 0]
    limit = MODEL.jnt_actfrcrange[hinges, 1]
    mass = np.empty((MODEL.nv, MODEL.nv))
    for j in range(15):
        data = settled(MIDDLE)
        mujoco.mj_fullM(MODEL, data, mass)
        adding = np.sign(RATES @ mass @ RATES[j])
        adding[j] = 0.0
        for t in steps(data, 0.08):
            data.ctrl[:] = MIDDLE + 0.5 * adding * SKELETON.max_acceleration_rad_s2 * t**2
            torque = abs(data.qfrc_actuator[MODEL.jnt_dofadr[hinges[j]]])
            assert torque < limit[j], SKELETON.joint_names[j]


def test_phalanges_follow_their_finger_by_the_tables_ratios() -> None:
    data = settled(NEUTRAL)
    fingers = np.array([n.endswith(FINGERS) for n in SKELETON.joint_names])
    assert fingers.sum() == 10
    data.ctrl[fingers] = SKELETON.upper_rad[fingers]
    for _ in steps(data, 0.5):
        coupled = data.qpos[LEADERS] @ RATES
        assert np.rad2deg(np.abs(data.qpos - coupled)).max() < 1.0
    wanted = data.ctrl @ RATES
    assert np.rad2deg(np.abs(data.qpos - wanted)).max() < 1.0
