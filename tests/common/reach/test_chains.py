"""Least squares over any robot's joints: exact within reach, nearest beyond it, bounded everywhere."""

from __future__ import annotations

import time

import numpy as np
import pytest

from common.quaternion import Array, angle_between, from_rotation_vector
from common.reach import ChainFollower, Follower, PostureFollower, make_follower
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import relative_orientations
from common.wire.messages import Mask
from tests.robots.imported import FILES, imported

PERIOD_S = 0.08


@pytest.fixture(params=FILES)
def skeleton(request: pytest.FixtureRequest) -> Skeleton:
    return load_skeleton(str(imported(str(request.param))))


def course(skeleton: Skeleton, seed: int, share: float = 0.35) -> Array:
    """(T, J): smooth, about the middle of what lies on the zero pose's side of every range."""
    random = np.random.default_rng(seed)
    low, high = skeleton.lower_rad, skeleton.upper_rad
    middle = np.clip(skeleton.zero_rad, low + 0.4 * (high - low), high - 0.4 * (high - low))
    t = PERIOD_S * np.arange(100)[:, None]
    swing = share * np.minimum(np.minimum(high - middle, middle - low), 0.8)
    return middle + swing * np.sin(random.uniform(0.5, 1.5, len(low)) * t + random.uniform(0, 6, len(low)))


def run(follower: Follower, skeleton: Skeleton, joints: Array) -> tuple[Array, Array]:
    """Positions and velocities (T, J) that a follower finds for the operator of those joint angles."""
    q = relative_orientations(skeleton, joints)
    h = 1e-4
    rate = np.gradient(joints, PERIOD_S, axis=0)
    ahead, behind = (relative_orientations(skeleton, joints + sign * h * rate) for sign in (1.0, -1.0))
    found = [follower.follow(*pair, PERIOD_S) for pair in zip(q, (ahead - behind) / (2 * h), strict=True)]
    return np.array([one[0] for one in found]), np.array([one[1] for one in found])


def limited(skeleton: Skeleton) -> ChainFollower:
    return ChainFollower(skeleton, skeleton.lower_rad, skeleton.upper_rad)


def test_each_robot_gets_the_follower_that_suits_it(skeleton: Skeleton) -> None:
    assert isinstance(make_follower(skeleton, skeleton.lower_rad, skeleton.upper_rad), ChainFollower)
    nursing = load_skeleton("nursing")
    assert isinstance(make_follower(nursing, nursing.lower_rad, nursing.upper_rad), PostureFollower)


@pytest.mark.parametrize("seed", range(3))
def test_within_reach_the_joints_are_found_again(skeleton: Skeleton, seed: int) -> None:
    joints = course(skeleton, seed)
    follower = limited(skeleton)
    position, velocity = run(follower, skeleton, joints)
    np.testing.assert_allclose(position, joints, atol=1e-6)
    # two joints that turn against each other are told no more than three times what their segment turns
    away = np.abs(velocity - np.gradient(joints, PERIOD_S, axis=0))[2:-2]
    assert np.quantile(away, 0.98) < 2e-3
    assert follower.short_rad.max() < 1e-6


def test_it_agrees_with_the_closed_formulas() -> None:
    """Two ways to the nursing robot's angles; its trunk's heading is free in both."""
    nursing = load_skeleton("nursing")
    joints = course(nursing, 1)
    ours, _ = run(limited(nursing), nursing, joints)
    theirs, _ = run(PostureFollower(nursing, nursing.lower_rad, nursing.upper_rad), nursing, joints)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_beyond_reach_no_posture_nearby_or_at_random_is_nearer(skeleton: Skeleton, seed: int) -> None:
    """Of each segment; joints of one segment do not help another."""
    random = np.random.default_rng(seed)
    wanted = from_rotation_vector(random.uniform(-1.5, 1.5, (len(skeleton.segments), 3)))
    follower = limited(skeleton)
    for _ in range(30):  # a search may be taken up again
        position, _ = follower.follow(wanted, np.zeros_like(wanted), PERIOD_S)
    assert np.all(position >= skeleton.lower_rad)
    assert np.all(position <= skeleton.upper_rad)
    reached = apart(skeleton, position, wanted)
    others = np.vstack([
        position + random.normal(0.0, 0.05, (500, len(position))),
        random.uniform(skeleton.lower_rad, skeleton.upper_rad, (2000, len(position))),
    ]).clip(skeleton.lower_rad, skeleton.upper_rad)  # fmt: skip
    nearest = apart(skeleton, others, wanted).min(axis=0)
    turned = np.array([bool(segment.turns) and segment.parent != "world" for segment in skeleton.segments])
    assert np.all(reached[turned] <= nearest[turned] + 1e-3)


def apart(skeleton: Skeleton, position: Array, wanted: Array) -> Array:
    """(..., N) rad between each segment's rotation and the operator's."""
    return angle_between(relative_orientations(skeleton, position), wanted)


def test_no_joint_turns_farther_at_once_than_the_operator_makes_it(skeleton: Skeleton) -> None:
    """Through singular postures and beyond limits: three times as far as the segment, or a slow creep."""
    random = np.random.default_rng(4)
    ways = random.normal(size=(len(skeleton.segments), 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    angles = 2.5 * np.sin(0.6 * PERIOD_S * np.arange(150))
    q = np.array([from_rotation_vector(ways * angle) for angle in angles])
    follower = limited(skeleton)
    positions = np.array([follower.follow(one, np.zeros_like(one), PERIOD_S)[0] for one in q])
    steps = np.abs(np.diff(positions, axis=0)).max(axis=1)
    assert np.all(steps <= 3.0 * np.abs(np.diff(angles)) + np.radians(1.8) + 1e-9)


def test_a_node_that_is_lost_leaves_the_others_alone(skeleton: Skeleton) -> None:
    joints = course(skeleton, 2)
    q = relative_orientations(skeleton, joints)
    follower, unharmed = limited(skeleton), limited(skeleton)
    lost = skeleton.segment_names.index("left_forearm")
    hit: Mask = np.array([
        any(skeleton.angle_slots[a][0] == lost for a in joint.drives) for joint in skeleton.joints
    ])  # fmt: skip
    for t, one in enumerate(q[:30]):
        with_gap = one.copy()
        if 10 <= t < 20:
            with_gap[lost] = np.nan
        position, velocity = follower.follow(with_gap, np.zeros_like(one), PERIOD_S)
        expected, _ = unharmed.follow(one, np.zeros_like(one), PERIOD_S)
        gap = hit & (10 <= t < 20)
        assert np.isnan(position[gap]).all()
        assert np.isnan(velocity[gap]).all()
        np.testing.assert_allclose(position[~gap], expected[~gap], atol=1e-6)


@pytest.mark.bench
def test_its_cost_beside_the_closed_formulas(skeleton: Skeleton) -> None:
    """A posture comes every 80 ms."""
    nursing = load_skeleton("nursing")
    costs = {}
    for name, robot in (("own", skeleton), ("nursing", nursing)):
        follower, joints = make_follower(robot, robot.lower_rad, robot.upper_rad), course(robot, 0)
        q = relative_orientations(robot, joints)
        begin = time.perf_counter()
        for one in q:
            follower.follow(one, np.zeros_like(one), PERIOD_S)
        costs[name] = (time.perf_counter() - begin) / len(q)
    assert costs["own"] < 100.0 * costs["nursing"]


def test_a_search_that_is_spread_ends_on_branches_as_near(skeleton: Skeleton) -> None:
    """After some postures alike, what is left is as little as where the whole search is made at once."""
    random = np.random.default_rng(4)
    at_once, spread = (
        ChainFollower(skeleton, skeleton.lower_rad, skeleton.upper_rad, spread=each) for each in (False, True)
    )
    for _ in range(10):
        joints = random.uniform(skeleton.lower_rad, skeleton.upper_rad)
        q = relative_orientations(skeleton, joints)
        still = np.zeros_like(q)
        for follower in (at_once, spread):
            follower.forget()
            for _ in range(12):
                follower.follow(q, still)
        assert np.abs(spread.short_rad - at_once.short_rad).max() < np.radians(2.0)


def test_a_spread_search_takes_few_steps_a_posture(
    skeleton: Skeleton, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted in linear systems that are solved, of which a whole search takes 450 at once."""
    follower = ChainFollower(skeleton, skeleton.lower_rad, skeleton.upper_rad, spread=True)
    solved: list[int] = []
    solve = np.linalg.solve

    def counted(matrix: Array, right: Array) -> Array:
        solved.append(len(matrix) if matrix.ndim == 3 else 0)
        return np.asarray(solve(matrix, right))

    monkeypatch.setattr(np.linalg, "solve", counted)
    random = np.random.default_rng(5)
    q = from_rotation_vector(1.5 * random.normal(size=(len(skeleton.segments), 3)))
    for _ in range(12):
        solved.clear()
        follower.follow(q, np.zeros_like(q))
        assert sum(solved) <= 15 * 6 + 10
