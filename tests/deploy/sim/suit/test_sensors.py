from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import (
    IDENTITY,
    angle_between,
    conjugate,
    from_axis_angle,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
)
from common.skeleton import Skeleton
from common.skeleton.kinematics import orientations
from common.skeleton.load import parse_skeleton
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import GRAVITY_M_S2, IdealSensors, earth_field_ut

FIELD_UT = earth_field_ut(50.0, 60.0)

PENDULUM = """
name = "pendulum"
[[segment]]
name = "rod"
parent = "world"
axes = "-y x z"
angles = "swing _ _"
origin_m = [0.0, 0.0, 1.0]
node_m = [0.0, 0.0, -0.4]
[[joint]]
name = "swing"
lower_deg = -180.0
upper_deg = 180.0
max_velocity_deg_s = 1000.0
max_acceleration_deg_s2 = 10000.0
"""


def test_a_pendulum_reads_gravity_and_its_own_acceleration() -> None:
    sensors = IdealSensors(parse_skeleton(PENDULUM, "pendulum"), FIELD_UT)
    angle, rate, push, length = 0.7, 5.0, -40.0, 0.4
    acc, gyr, _ = np.split(sensors.read(np.array([angle]), np.array([rate]), np.array([push]))[0], 3)
    # the sensor's x points along the swing, its z to the pivot
    ahead = GRAVITY_M_S2 * np.sin(angle) + length * push
    to_pivot = GRAVITY_M_S2 * np.cos(angle) + length * rate**2
    np.testing.assert_allclose(acc, [ahead, 0.0, to_pivot], atol=1e-12)
    np.testing.assert_allclose(gyr, [0.0, -rate, 0.0], atol=1e-12)


def test_a_body_in_free_fall_along_the_swing_reads_no_force_along_it() -> None:
    """A frictionless pendulum obeys θ̈ = −g sin θ / L, so the sensor feels only the rod's pull."""
    sensors = IdealSensors(parse_skeleton(PENDULUM, "pendulum"), FIELD_UT)
    angle = 1.1
    push = -GRAVITY_M_S2 * np.sin(angle) / 0.4
    acc = sensors.read(np.array([angle]), np.zeros(1), np.array([push]))[0, :3]
    np.testing.assert_allclose(acc, [0.0, 0.0, GRAVITY_M_S2 * np.cos(angle)], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_at_rest_readings_are_gravity_and_field_in_the_segment(skeleton: Skeleton, seed: int) -> None:
    random = np.random.default_rng(seed)
    position = random.uniform(skeleton.lower_rad, skeleton.upper_rad)
    still = np.zeros(len(skeleton.joints))
    readings = IdealSensors(skeleton, FIELD_UT).read(position, still, still)
    q_segment_from_world = conjugate(orientations(skeleton, position))
    up = np.array([0.0, 0.0, GRAVITY_M_S2])
    np.testing.assert_allclose(readings[:, 0:3], rotate(q_segment_from_world, up), atol=1e-12)
    np.testing.assert_allclose(readings[:, 3:6], 0.0, atol=1e-12)
    np.testing.assert_allclose(readings[:, 6:9], rotate(q_segment_from_world, FIELD_UT), atol=1e-12)


def test_the_field_points_north_and_dips() -> None:
    np.testing.assert_allclose(earth_field_ut(50.0, 60.0), [0.0, 25.0, -43.30127], atol=1e-5)
    assert earth_field_ut(50.0, -60.0)[2] > 0.0


def test_field_strength_and_dip_do_not_depend_on_the_posture(skeleton: Skeleton) -> None:
    random = np.random.default_rng(3)
    position = random.uniform(skeleton.lower_rad, skeleton.upper_rad)
    still = np.zeros(len(skeleton.joints))
    readings = IdealSensors(skeleton, FIELD_UT).read(position, still, still)
    np.testing.assert_allclose(np.linalg.norm(readings[:, 6:9], axis=1), 50.0)
    upward = np.sum(readings[:, 0:3] * readings[:, 6:9], axis=1) / (GRAVITY_M_S2 * 50.0)
    np.testing.assert_allclose(upward, -np.sin(np.radians(60.0)))


def test_a_sensor_worn_askew_reads_the_same_vectors_in_its_frame(skeleton: Skeleton) -> None:
    random = np.random.default_rng(4)
    count = len(skeleton.segments)
    alignment = normalise(random.standard_normal((count, 4)))
    position = random.uniform(skeleton.lower_rad, skeleton.upper_rad)
    velocity, acceleration = random.standard_normal((2, len(skeleton.joints)))
    aligned = IdealSensors(skeleton, FIELD_UT).read(position, velocity, acceleration)
    askew = IdealSensors(skeleton, FIELD_UT, alignment).read(position, velocity, acceleration)
    for sensor in (slice(0, 3), slice(3, 6), slice(6, 9)):
        np.testing.assert_allclose(rotate(alignment, askew[:, sensor]), aligned[:, sensor], atol=1e-12)


def test_a_quarter_turn_about_the_long_axis() -> None:
    """By hand, so that the direction of `q_segment_from_sensor` is not left to convention."""
    skeleton = parse_skeleton(PENDULUM, "pendulum")
    alignment = from_axis_angle([0.0, 0.0, 1.0], np.pi / 2)[None]
    reading = IdealSensors(skeleton, FIELD_UT, alignment).read(*np.zeros((3, 1)))[0]
    # the sensor's x lies along the segment's y, which points north
    np.testing.assert_allclose(reading[6:], [25.0, 0.0, FIELD_UT[2]], atol=1e-12)


def test_integrated_gyros_follow_through_the_fast_phases(skeleton: Skeleton) -> None:
    motion = load_motion("bottle", skeleton)
    sensors = IdealSensors(skeleton, FIELD_UT)
    step_s, begin_s, end_s = 0.002, 3.4, 8.0
    q = orientations(skeleton, motion.state(begin_s)[0])
    for t_s in np.arange(begin_s + step_s / 2, end_s, step_s):
        rate = sensors.read(*motion.state(t_s))[:, 3:6]
        q = multiply(q, from_rotation_vector(rate * step_s))
    expected = orientations(skeleton, motion.state(end_s)[0])
    assert angle_between(expected, np.tile(IDENTITY, (len(q), 1))).max() > 1.0
    assert angle_between(q, expected).max() < 1e-5
