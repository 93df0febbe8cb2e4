from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, multiply, rotate
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from master.joint_angles.decomposition import JointAngles
from master.orientation.triad import q_from_gravity_and_field

LEGS = load_skeleton("lower_limb")
FIELD_UT = earth_field_ut(50.0, 60.0)
UP_M_S2 = np.array([0.0, 0.0, 9.81])


@settings(max_examples=80)
@given(st.lists(st.floats(-2.5, 2.5), min_size=3, max_size=3))
def test_any_attitude_is_found(turn: list[float]) -> None:
    """Against scipy, which makes the readings."""
    truth = Rotation.from_rotvec(turn)
    acc, mag = (np.asarray(truth.inv().apply(v)) for v in (UP_M_S2, FIELD_UT))
    found = q_from_gravity_and_field(acc, mag)
    assert (truth.inv() * Rotation.from_quat(np.roll(found, -1))).magnitude() < 1e-6


def test_upside_down_too() -> None:
    q = from_rotation_vector(np.array([[np.pi, 0.0, 0.0], [0.0, np.pi, 0.0]]))
    found = q_from_gravity_and_field(rotate(conjugate(q), UP_M_S2), rotate(conjugate(q), FIELD_UT))
    np.testing.assert_allclose(angle_between(found, q), 0.0, atol=1e-6)


@pytest.mark.filterwarnings("ignore:invalid value")
def test_without_a_horizontal_field_there_is_no_answer() -> None:
    assert np.isnan(q_from_gravity_and_field(UP_M_S2, np.array([0.0, 0.0, -40.0]))).all()
    assert np.isnan(q_from_gravity_and_field(np.zeros(3), FIELD_UT)).all()


@pytest.mark.parametrize("seed", range(5))
def test_two_nodes_give_the_hip_s_three_angles(seed: int) -> None:
    """Held still in any posture, sensors askew: the solver's angles, and scipy's of the same two nodes."""
    random = np.random.default_rng(seed)
    position = random.uniform(LEGS.lower_rad, LEGS.upper_rad)
    askew = from_rotation_vector(random.standard_normal((7, 3)) * 0.4)
    still = np.zeros(10)
    readings = IdealSensors(LEGS, FIELD_UT, askew).read(position, still, still)
    q: Array = multiply(q_from_gravity_and_field(readings[:, 0:3], readings[:, 6:9]), conjugate(askew))
    np.testing.assert_allclose(angle_between(q, orientations(LEGS, position)), 0.0, atol=1e-6)
    solved, _ = JointAngles(LEGS).solve(q, np.zeros((7, 3)))
    np.testing.assert_allclose(solved, position, atol=1e-6)
    thigh = LEGS.segment_names.index("right_thigh")
    pelvis_from_thigh = np.roll(multiply(conjugate(q[0]), q[thigh]), -1)
    flexion, abduction, rotation = Rotation.from_quat(pelvis_from_thigh).as_euler("YXZ")
    np.testing.assert_allclose([-flexion, -abduction, rotation], position[5:8], atol=1e-6)
