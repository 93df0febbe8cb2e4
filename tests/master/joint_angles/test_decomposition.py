import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import (
    Array,
    conjugate,
    from_rotation_vector,
    heading_turn,
    multiply,
    to_rotation_vector,
)
from common.skeleton import WORLD, load_skeleton
from common.skeleton.kinematics import orientations
from master.joint_angles.decomposition import JointAngles
from master.joint_angles.rates import COSINE_FLOOR

SKELETON = load_skeleton("nursing")
SOLVER = JointAngles(SKELETON)
JOINTS, NODES = len(SKELETON.joints), len(SKELETON.segments)
STILL = np.zeros((NODES, 3))

fractions = st.lists(
    st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 1.0)), min_size=JOINTS, max_size=JOINTS
).map(np.array)


def within_limits(fraction: Array) -> Array:
    return SKELETON.lower_rad + fraction * (SKELETON.upper_rad - SKELETON.lower_rad)


def random_poses(count: int, seed: int) -> Array:
    return within_limits(np.random.default_rng(seed).uniform(size=(count, JOINTS)))


def rates_between(before: Array, after: Array, seconds: float) -> Array:
    """Mean rates of the segments, own frame."""
    return to_rotation_vector(multiply(conjugate(before), after)) / seconds


@given(fractions, st.floats(-np.pi, np.pi))
def test_poses_are_recovered_over_the_whole_range_and_at_the_limits(fraction: Array, heading: float) -> None:
    position = within_limits(fraction)
    solved, velocity = SOLVER.solve(orientations(SKELETON, position, heading), STILL)
    assert np.max(np.abs(solved - position)) < 1e-9
    assert np.array_equal(velocity, np.zeros(JOINTS))


def test_the_sign_of_a_quaternion_changes_nothing() -> None:
    rng = np.random.default_rng(0)
    for position in random_poses(20, 0):
        q = orientations(SKELETON, position)
        signs = rng.choice([-1.0, 1.0], size=(NODES, 1))
        assert np.allclose(SOLVER.solve(q, STILL)[0], SOLVER.solve(signs * q, STILL)[0], atol=1e-12)


def test_every_segment_s_angles_are_scipy_s_intrinsic_ones() -> None:
    """With residual angles too, which the robot cannot follow: as_euler knows only positive axes."""
    rotations = Rotation.random(NODES, rng=5)
    q = np.empty((NODES, 4))
    for i, parent in enumerate(SKELETON.parents):
        relative = rotations[i].as_quat(scalar_first=True)
        q[i] = relative if parent < 0 else multiply(q[parent], relative)
    expected = np.empty((NODES, 3))
    for i, segment in enumerate(SKELETON.segments):
        order = "".join("XYZ"[int(np.argmax(np.abs(axis)))] for axis in segment.axes)
        sign = np.array([sum(axis) for axis in segment.axes])
        expected[i] = sign * rotations[i].as_euler(order)  # type: ignore[call-overload]
    solved, _ = SOLVER.solve(q, STILL)
    assert np.allclose(solved, SKELETON.joints_from_angles @ expected.ravel(), atol=1e-9)


def test_velocities_are_the_derivative_of_the_poses() -> None:
    rng = np.random.default_rng(1)
    h = 1e-6
    for position in random_poses(20, 1):
        velocity = rng.normal(size=JOINTS)
        turning = rng.normal()
        q, before, after = (
            orientations(SKELETON, position + s * velocity, s * turning) for s in (0.0, -h / 2, h / 2)
        )
        _, solved = SOLVER.solve(q, rates_between(before, after, h))
        assert np.allclose(solved, velocity, atol=1e-7)


def test_velocities_are_the_derivative_of_the_solved_positions() -> None:
    rng = np.random.default_rng(2)
    h = 1e-6
    for position in random_poses(20, 2):
        stray = from_rotation_vector(rng.normal(scale=0.1, size=(NODES, 3)))
        q = multiply(orientations(SKELETON, position), stray)
        rate = rng.normal(size=(NODES, 3))
        ahead, _ = SOLVER.solve(multiply(q, from_rotation_vector(0.5 * h * rate)), STILL)
        back, _ = SOLVER.solve(multiply(q, from_rotation_vector(-0.5 * h * rate)), STILL)
        position_now, velocity = SOLVER.solve(q, rate)
        assert np.allclose(velocity, (ahead - back) / h, atol=1e-5, rtol=1e-5)
        assert np.allclose(position_now, 0.5 * (ahead + back), atol=1e-9)


@given(st.floats(-np.pi, np.pi))
def test_turning_the_whole_world_about_the_vertical_changes_nothing(heading: float) -> None:
    rng = np.random.default_rng(3)
    q = multiply(orientations(SKELETON, random_poses(1, 3)[0]), from_rotation_vector(0.1 * np.ones(3)))
    rate = rng.normal(size=(NODES, 3))
    position, velocity = SOLVER.solve(q, rate)
    turned, turned_velocity = SOLVER.solve(multiply(heading_turn(heading), q), rate)
    assert np.allclose(turned, position, atol=1e-12)
    assert np.allclose(turned_velocity, velocity, atol=1e-12)


def test_the_operator_turning_round_moves_no_joint() -> None:
    q = orientations(SKELETON, random_poses(1, 4)[0])
    spin = np.array([0.0, 0.0, 2.0])
    rate = np.array([Rotation.from_quat(one, scalar_first=True).inv().apply(spin) for one in q])
    assert np.allclose(SOLVER.solve(q, rate)[1], 0.0, atol=1e-12)


def test_a_joint_of_several_angles_follows_them_by_least_squares() -> None:
    """One phalanx bent by hand: the joint's error is spread, none of the other joints notices."""
    joint = SKELETON.joint_names.index("left_index")
    q = orientations(SKELETON, np.zeros(JOINTS))
    bent = 0.3
    distal = SKELETON.segment_names.index("left_index_distal")
    q[distal] = multiply(q[distal], from_rotation_vector(np.array([-bent, 0.0, 0.0])))
    solved, _ = SOLVER.solve(q, STILL)
    assert solved[joint] == pytest.approx(0.7 * bent / (1.0 + 1.1**2 + 0.7**2))
    assert np.allclose(np.delete(solved, joint), 0.0, atol=1e-15)


@pytest.mark.parametrize("beyond_rad", [0.0, 1e-300, 1e-12, 1e-6, 0.01, -1e-12, -0.01])
def test_at_the_middle_angle_s_singularity_all_stays_finite(beyond_rad: float) -> None:
    roll = SKELETON.joint_names.index("left_shoulder_roll")
    position = np.zeros(JOINTS)
    position[roll] = np.pi / 2 + beyond_rad
    q = orientations(SKELETON, position)
    rate = np.random.default_rng(6).normal(size=(NODES, 3))
    solved, velocity = SOLVER.solve(q, rate)
    assert np.all(np.isfinite(solved))
    assert np.abs(solved[roll] - np.pi / 2) <= abs(beyond_rad) + 1e-7
    fastest = 2.0 * np.max(np.linalg.norm(rate, axis=-1))
    # no rate map lies on the floor but the left shoulder's
    assert np.all(np.abs(velocity) <= 1.01 * fastest * (1.0 / COSINE_FLOOR + 1.0))
    assert np.all(np.isfinite(velocity))


def test_rates_are_exact_up_to_two_degrees_from_the_singularity() -> None:
    roll = SKELETON.joint_names.index("left_shoulder_roll")
    velocity = np.random.default_rng(7).normal(size=JOINTS)
    h = 1e-6

    def solved_at(roll_deg: float) -> Array:
        position = np.zeros(JOINTS)
        position[roll] = np.radians(roll_deg)
        q, before, after = (orientations(SKELETON, position + s * velocity) for s in (0.0, -h / 2, h / 2))
        return SOLVER.solve(q, rates_between(before, after, h))[1]

    assert np.allclose(solved_at(87.9), velocity, atol=1e-5)
    assert not np.allclose(solved_at(89.5), velocity, atol=1e-2)


def test_nan_stays_within_the_joints_that_need_its_node() -> None:
    q = orientations(SKELETON, random_poses(1, 8)[0])
    rate = np.random.default_rng(8).normal(size=(NODES, 3))
    position, velocity = SOLVER.solve(q, rate)
    for node in range(NODES):
        broken_q, broken_rate = q.copy(), rate.copy()
        broken_q[node] = np.nan
        broken_rate[node] = np.nan
        hit = SKELETON.joint_needs_node[:, node]
        found, found_velocity = SOLVER.solve(broken_q, broken_rate)
        assert np.array_equal(found[~hit], position[~hit])
        assert np.array_equal(found_velocity[~hit], velocity[~hit])


def test_the_world_gives_only_the_vertical() -> None:
    assert SKELETON.segments[0].parent == WORLD
    lean = np.zeros(JOINTS)
    lean[SKELETON.joint_names.index("waist_pitch")] = 0.5
    for heading in (0.0, 1.0, 3.0):
        assert np.allclose(SOLVER.solve(orientations(SKELETON, lean, heading), STILL)[0], lean, atol=1e-12)
