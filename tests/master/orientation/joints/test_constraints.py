from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import Array, from_axis_angle, heading_turn, multiply
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations
from master.orientation.joints.constraints import JointConstraints

STEP_RAD = 1e-6
PROFILES = ["nursing", "lower_limb"]


def pose(skeleton: Skeleton, seed: int) -> Array:
    """Orientations (N, 4) somewhere within all limits."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(skeleton.lower_rad, skeleton.upper_rad)
    found: Array = orientations(skeleton, joints[None], rng.uniform(-3.0, 3.0))[0]
    return found


@pytest.mark.parametrize("profile", PROFILES)
@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_a_person_s_pose_violates_no_joint(profile: str, seed: int) -> None:
    skeleton = load_skeleton(profile)
    error, _ = JointConstraints(skeleton).measure(pose(skeleton, seed))
    np.testing.assert_allclose(error, 0.0, atol=1e-12)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_the_derivative_is_that_of_finite_differences(seed: int) -> None:
    skeleton = load_skeleton("nursing")
    joints, count = JointConstraints(skeleton), len(skeleton.segments)
    q = Rotation.random(count, rng=seed).as_quat(scalar_first=True)
    error, slope = joints.measure(q)
    assert np.abs(error).max() > 0.1
    for node in range(count):
        step = np.zeros(count)
        step[node] = STEP_RAD
        after, before = (joints.measure(multiply(heading_turn(s), q))[0] for s in (step, -step))
        expected = slope * (joints.child == node) - slope * (joints.parent == node)
        np.testing.assert_allclose((after - before) / (2.0 * STEP_RAD), expected, atol=1e-8)


def test_turning_everybody_together_changes_nothing() -> None:
    skeleton = load_skeleton("nursing")
    joints = JointConstraints(skeleton)
    q = Rotation.random(36, rng=0).as_quat(scalar_first=True)
    turned = multiply(heading_turn(np.full(36, 1.3)), q)
    np.testing.assert_allclose(joints.measure(turned), joints.measure(q), atol=1e-12)


def test_an_upright_axis_tells_nothing_of_the_heading() -> None:
    """A shank swung about an upright axis: any heading of it is a knee angle that there can be."""
    skeleton = load_skeleton("lower_limb")
    joints = JointConstraints(skeleton)
    # the whole leg lies on its side: the knee's axis (y) stands up
    q = np.tile(from_axis_angle([1.0, 0.0, 0.0], np.pi / 2.0), (7, 1))
    knees = np.isin(joints.child, [skeleton.segment_names.index(f"{s}_shank") for s in ("left", "right")])
    for heading in (0.0, 0.5, -1.0):
        turned = multiply(heading_turn(np.array([0, 0, heading, 0, 0, heading, 0])), q)
        error, slope = joints.measure(turned)
        np.testing.assert_allclose(error[knees], 0.0, atol=1e-12)
        np.testing.assert_allclose(slope[knees], 0.0, atol=1e-12)


def test_which_joints_constrain() -> None:
    skeleton = load_skeleton("nursing")
    joints = JointConstraints(skeleton)
    names = [skeleton.segment_names[i] for i in joints.child]
    assert names.count("left_forearm") == 1
    assert names.count("left_index_proximal") == 1
    assert names.count("left_index_middle") == 2
    assert not {"chest", "head", "left_upper_arm", "left_hand"} & set(names)
