"""Against the forward kinematics of common/, differentiated numerically: another formula, another author."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array, conjugate, multiply, rotate, to_matrix, to_rotation_vector
from common.skeleton import Skeleton
from common.skeleton.kinematics import orientations, origins
from deploy.sim.suit.chain import Chain

H_S = 2e-4
"""Truncation h²/12 x⁗ ~ 1e-7 m/s² and rounding 4 ε / h² ~ 2e-8 m/s²: both far below a count (2.4e-3)."""


class Course:
    """A posture with every joint moving: position quadratic in time."""

    def __init__(self, skeleton: Skeleton, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.skeleton = skeleton
        self.position = random.uniform(skeleton.lower_rad, skeleton.upper_rad)
        self.velocity = random.uniform(-4.0, 4.0, len(skeleton.joints))
        self.acceleration = random.uniform(-30.0, 30.0, len(skeleton.joints))
        self._node_m = np.array([s.node_m for s in skeleton.segments])

    def orientation(self, t_s: float) -> Array:
        at = self.position + self.velocity * t_s + 0.5 * self.acceleration * t_s**2
        return orientations(self.skeleton, at)

    def node_place(self, t_s: float) -> Array:
        q = self.orientation(t_s)
        return origins(self.skeleton, q) + rotate(q, self._node_m)


@pytest.fixture(params=range(5))
def course(request: pytest.FixtureRequest, skeleton: Skeleton) -> Course:
    return Course(skeleton, request.param)


@pytest.fixture(scope="module")
def chain(skeleton: Skeleton) -> Chain:
    return Chain(skeleton)


def test_orientations_are_those_of_the_kinematics(chain: Chain, course: Course) -> None:
    motion = chain.motion(course.position, course.velocity, course.acceleration)
    np.testing.assert_allclose(motion.world_from_segment, to_matrix(course.orientation(0.0)), atol=1e-14)


def test_rates_are_the_derivative_of_the_orientations(chain: Chain, course: Course) -> None:
    turned = multiply(course.orientation(H_S), conjugate(course.orientation(-H_S)))
    expected = to_rotation_vector(turned) / (2.0 * H_S)
    motion = chain.motion(course.position, course.velocity, course.acceleration)
    np.testing.assert_allclose(motion.rate_rad_s, expected, atol=2e-5)


def test_accelerations_are_the_second_derivative_of_the_nodes_places(chain: Chain, course: Course) -> None:
    before, at, after = (course.node_place(t) for t in (-H_S, 0.0, H_S))
    expected = (after - 2.0 * at + before) / H_S**2
    motion = chain.motion(course.position, course.velocity, course.acceleration)
    assert np.abs(expected).max() > 10.0
    np.testing.assert_allclose(motion.node_acceleration_m_s2, expected, atol=2e-4)
