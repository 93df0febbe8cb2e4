"""Every profile through the one solver; the hand's five synergies against nursing's five finger joints."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations
from common.skeleton.synergy import synergy_positions
from master.joint_angles.decomposition import JointAngles
from master.joint_angles.solver import JointSolver

PROFILES = pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
HAND, NURSING = load_skeleton("hand"), load_skeleton("nursing")
FIVE = [NURSING.joint_names.index(f"right_{f}") for f in ("thumb", "index", "middle", "ring", "little")]
H_S = 1e-6


def moving(skeleton: Skeleton, rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions within the limits, and velocities."""
    position = rng.uniform(skeleton.lower_rad, skeleton.upper_rad)
    return position, rng.uniform(-1.0, 1.0, len(position)) * skeleton.max_velocity_rad_s


def rates(before: Array, q: Array, after: Array) -> Array:
    """Body rates (N, 3) by central difference over H_S each way."""
    turn = multiply(conjugate(before), after)
    turn *= np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    half: Array = turn[:, 1:] / H_S
    return half


@PROFILES
@pytest.mark.parametrize("seed", range(5))
def test_the_solver_inverts_the_kinematics_of_every_profile(profile: str, seed: int) -> None:
    skeleton = load_skeleton(profile)
    rng = np.random.default_rng(seed)
    position, velocity = moving(skeleton, rng)
    heading = rng.uniform(-3.0, 3.0)
    before, q, after = (
        orientations(skeleton, position + s * H_S * velocity, heading) for s in (-1.0, 0.0, 1.0)
    )
    solved, solved_rate = JointSolver(skeleton).solve(q, rates(before, q, after))
    np.testing.assert_allclose(solved, position, atol=1e-9)
    np.testing.assert_allclose(solved_rate, velocity, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_the_hand_s_synergies_are_nursing_s_for_the_same_glove(seed: int) -> None:
    """Whatever the phalanges do, abduction and twist that neither robot follows included."""
    rng = np.random.default_rng(seed)
    position, _ = moving(HAND, rng)
    q_hand = orientations(HAND, position, 0.7)
    q_hand = multiply(q_hand, from_rotation_vector(rng.normal(0.0, 0.2, (len(q_hand), 3))))
    rate_hand = rng.normal(0.0, 2.0, (len(q_hand), 3))
    glove = [NURSING.segment_names.index(name) for name in HAND.segment_names]
    q = orientations(NURSING, np.zeros(len(NURSING.joints)))
    rate = np.zeros((len(q), 3))
    q[glove], rate[glove] = q_hand, rate_hand
    # without limits: beyond them 14 joints and five go different ways
    fourteen, fourteen_rates = JointAngles(HAND).solve(q_hand, rate_hand)
    nursing, nursing_rates = JointAngles(NURSING).solve(q, rate)
    np.testing.assert_allclose(synergy_positions(HAND, fourteen), nursing[FIVE], atol=1e-12)
    np.testing.assert_allclose(synergy_positions(HAND, fourteen_rates), nursing_rates[FIVE], atol=1e-11)


def test_fingers_of_the_right_hand_bend_towards_its_palm() -> None:
    # hanging, its palm faces the thigh: bent by a right angle, the fingers point to the left
    position = np.array([np.pi / 2 if name.endswith("_mpj") else 0.0 for name in HAND.joint_names])
    position[0] = 0.0  # but for the thumb
    q = orientations(HAND, position)
    fingers = [HAND.segment_names.index(f"right_{f}_proximal") for f in ("index", "middle", "ring", "little")]
    along = rotate(q[fingers], np.tile([0.0, 0.0, -1.0], (4, 1)))
    np.testing.assert_allclose(along, np.tile([0.0, 1.0, 0.0], (4, 1)), atol=1e-12)
