"""The tray's readings are those of a rigid body: they integrate to each other, and rest where they should."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import conjugate, from_rotation_vector, multiply, rotate
from common.skeleton import load_skeleton
from deploy.sim.suit.joint_moves import JointMoves
from deploy.sim.suit.sensors import GRAVITY_M_S2
from deploy.sim.suit.tray import PITCH_M, Tray, TrayConfig

STEP_S = 4e-3
CONFIG = TrayConfig(attitudes=20, still_s=0.5, tumble_s=3.0)
FIELD = np.array([0.0, 25.0, -43.0])


@pytest.fixture(scope="module")
def readings() -> np.ndarray:
    """(T, 9, 9) over the whole period at 250 Hz."""
    tray = Tray(CONFIG, 9, seed=4)
    return np.array([tray.readings(t, FIELD) for t in np.arange(0.0, tray.period_s, STEP_S)])


def test_it_rests_in_as_many_attitudes_as_told_with_up_all_around(readings: np.ndarray) -> None:
    still = np.abs(readings[:, 0, 3:6]).max(axis=1) == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    rests = [(a, b) for a, b in edges.reshape(-1, 2) if b - a > 100]
    assert len(rests) == 20
    assert all(b - a == pytest.approx(125, abs=2) for a, b in rests)
    up = np.array([readings[(a + b) // 2, 0, :3] for a, b in rests]) / GRAVITY_M_S2
    assert np.linalg.norm(up, axis=1) == pytest.approx(1.0)
    assert np.linalg.eigvalsh(up.T @ up / 20)[0] > 0.3  # a third, were it quite even


def test_the_rates_carry_gravity_and_field_from_rest_to_rest(readings: np.ndarray) -> None:
    q = np.array([1.0, 0.0, 0.0, 0.0])
    turning = readings[:1000, 0, 3:6]  # over two rests and the turns between them
    for turn in from_rotation_vector(0.5 * STEP_S * (turning[1:] + turning[:-1])):
        q = multiply(q, turn)
    begin, end = readings[0, 4], readings[999, 4]  # the one in the middle
    assert np.linalg.norm(begin[:3] - end[:3]) > 1.0
    assert rotate(conjugate(q), begin[6:]) == pytest.approx(end[6:], abs=0.02)
    assert rotate(conjugate(q), begin[:3]) == pytest.approx(end[:3], abs=0.02)


def test_units_feel_their_distance_as_a_rigid_body_would(readings: np.ndarray) -> None:
    """The difference of two units' accelerations, integrated twice in the world, is their lever's course."""
    first, last = readings[:, 0], readings[:, -1]
    assert (first[:, 3:] == last[:, 3:]).all()
    lever = 2.0 * PITCH_M * np.array([1.0, 1.0, 0.0])
    rate = first[:, 3:6]
    change = np.gradient(rate, STEP_S, axis=0)
    expected = np.cross(change, lever) + np.cross(rate, np.cross(rate, lever))
    assert np.abs(expected).max() > 0.3
    assert np.abs((last - first)[:, :3] - expected)[5:-5].max() < 0.05


def test_it_loops_without_a_jump() -> None:
    tray = Tray(CONFIG, 2)
    assert tray.readings(tray.period_s - 1e-7, FIELD) == pytest.approx(tray.readings(0.0, FIELD), abs=1e-3)


@pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
def test_it_moves_every_joint_within_its_limits_and_consistently(profile: str) -> None:
    skeleton = load_skeleton(profile)
    move_joints = JointMoves(skeleton)
    t = np.arange(0.0, move_joints.period_s + 1.0, 1e-3)
    position, velocity, acceleration = move_joints.state(t)
    assert (position >= skeleton.lower_rad - 1e-9).all()
    assert (position <= skeleton.upper_rad + 1e-9).all()
    assert (np.ptp(position, axis=0) > np.radians(15.0)).all()
    assert np.abs(np.gradient(position, 1e-3, axis=0) - velocity)[1:-1].max() < 1e-3
    # the jerk of a quintic is not continuous
    assert np.abs(np.gradient(velocity, 1e-3, axis=0) - acceleration)[1:-1].max() < 0.1
    zero_pose = (t > move_joints.zero_pose_from_s) & (t < move_joints.zero_pose_until_s)
    assert (velocity[zero_pose] == 0.0).all()
    assert (position[zero_pose] == np.clip(0.0, skeleton.lower_rad, skeleton.upper_rad)).all()
