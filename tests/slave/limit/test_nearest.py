"""A site's tighter limits of a shoulder make the nearest posture of it, not another one joint by joint."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array, conjugate, multiply
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations, relative_orientations
from slave.guard import GuardConfig
from slave.guard.config import JointLimits
from slave.limit.nearest import NearestPosture

SKELETON = load_skeleton("nursing")
NAMES = SKELETON.joint_names
ALL = np.ones(len(NAMES), np.bool_)
ARM = [NAMES.index(f"left_shoulder_{which}") for which in ("pitch", "roll", "yaw")]
PERIOD_NS = 80_000_000


def made(**joints: JointLimits) -> NearestPosture:
    return NearestPosture(SKELETON, GuardConfig(joints=joints).limits(SKELETON))


def arm(pitch_deg: float, roll_deg: float, yaw_deg: float) -> Array:
    position = np.zeros(len(NAMES))
    position[ARM] = np.radians([pitch_deg, roll_deg, yaw_deg])
    return position


def left_rad(position: Array, other: Array) -> float:
    row = SKELETON.segment_names.index("left_upper_arm")
    p, q = relative_orientations(SKELETON, np.stack([position, other]))[:, row]
    return float(2.0 * np.arccos(min(1.0, abs(p @ q))))


def test_rotations_relative_to_neighbours_are_the_world_s() -> None:
    position = np.random.default_rng(1).uniform(SKELETON.lower_rad, SKELETON.upper_rad)
    q, relative = orientations(SKELETON, position), relative_orientations(SKELETON, position)
    for i, parent in enumerate(SKELETON.parents):
        expected = q[i] if parent < 0 else multiply(conjugate(q[parent]), q[i])
        np.testing.assert_allclose(relative[i], expected, atol=1e-12)


def test_without_tighter_limits_a_command_is_what_it_was() -> None:
    position, velocity = arm(170.0, 100.0, 90.0), np.ones(len(NAMES))
    found, its_velocity = made().of(0, position, velocity, ALL)
    assert found is position
    assert its_velocity is velocity


def test_within_the_tighter_limits_a_command_is_what_it_was() -> None:
    tighter = made(left_shoulder_roll=JointLimits(upper_deg=60.0))
    rng = np.random.default_rng(2)
    velocity = np.zeros(len(NAMES))
    for k in range(100):
        position = arm(40.0 + k, 30.0 + 0.2 * k, 0.0)
        velocity[ARM] = rng.normal(size=3)
        found, its_velocity = tighter.of(k * PERIOD_NS, position, velocity, ALL)
        np.testing.assert_allclose(found, position, atol=1e-9)
        np.testing.assert_allclose(its_velocity, velocity, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_beyond_limits_it_is_nearer_than_joint_by_joint(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tighter = GuardConfig(
        joints={
            "left_shoulder_pitch": JointLimits(upper_deg=60.0),
            "left_shoulder_yaw": JointLimits(lower_deg=-20.0, upper_deg=20.0),
        }
    )
    limits = tighter.limits(SKELETON)
    position = rng.uniform(SKELETON.lower_rad, SKELETON.upper_rad)
    position[ARM] = np.radians([rng.uniform(70.0, 150.0), rng.uniform(0.0, 60.0), rng.uniform(30.0, 80.0)])
    found, velocity = NearestPosture(SKELETON, limits).of(0, position, np.zeros(len(NAMES)), ALL)
    assert left_rad(found, position) <= left_rad(limits.reachable(position), position) + 1e-9
    assert np.array_equal(found, limits.reachable(found))
    np.testing.assert_array_equal(np.delete(found, ARM), np.delete(position, ARM))
    assert np.isfinite(velocity).all()


def test_a_joint_that_is_not_valid_stays_as_it_came() -> None:
    tighter = made(left_shoulder_roll=JointLimits(upper_deg=40.0))
    valid = ALL.copy()
    valid[ARM] = False
    position = arm(0.0, 70.0, 0.0)
    found, _ = tighter.of(0, position, np.zeros(len(NAMES)), valid)
    np.testing.assert_array_equal(found, position)


def test_a_posture_that_passes_a_tighter_limit_does_not_jump() -> None:
    tighter = made(left_shoulder_roll=JointLimits(upper_deg=70.0))
    before = arm(20.0, 50.0, 10.0)
    tighter.of(0, before, np.zeros(len(NAMES)), ALL)
    for k, roll_deg in enumerate(np.arange(50.0, 80.0, 0.5), start=1):
        now, _ = tighter.of(k * PERIOD_NS, arm(20.0, roll_deg, 10.0), np.zeros(len(NAMES)), ALL)
        assert np.abs(now - before).max() <= np.radians(1.5 * 0.5 + 2.0)
        before = now
    np.testing.assert_allclose(np.degrees(before[ARM[1]]), 70.0, atol=1e-6)
