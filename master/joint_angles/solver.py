"""From the segments' orientations and rates to positions and velocities that the robot's joints can take."""

from __future__ import annotations

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, multiply
from common.reach import NOMINAL_S, make_follower
from common.skeleton import Skeleton


class JointSolver:
    """One operator's postures, one after another, as those of a robot (common/reach says how).

    Within the robot's limits these are the angles of Zuo, Yu and Gong (2016), Eqs 13 to 24, with their signs
    and without their arccos. Beyond them they are those of the nearest posture, reached without a jump: so
    each answer depends on the ones before, until `forget`.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        count = len(skeleton.segments)
        # row `count` of the buffers is the world: no rotation, no rate
        self._q = np.tile(IDENTITY, (count + 1, 1))
        self._rate = np.zeros((count + 1, 3))
        self._parents = np.where(skeleton.parents < 0, count, skeleton.parents)
        self._rates = np.empty((count, 6))
        self._reach = make_follower(skeleton, skeleton.lower_rad, skeleton.upper_rad, spread=True)

    @property
    def short_rad(self) -> Array:
        """(N,) what the robot cannot follow of each segment: the angle from the robot's posture to theirs."""
        return self._reach.short_rad

    def forget(self) -> None:
        """The next posture has nothing to do with those before: it becomes the nearest there is."""
        self._reach.forget()

    def solve(
        self, q_world_from_segment: Array, rate_rad_s: Array, elapsed_s: float = NOMINAL_S
    ) -> tuple[Array, Array]:
        """Joint positions (J,) rad, all within limits, and velocities (J,) rad/s.

        Takes orientations (N, 4), the segments' rates (N, 3), each in its own frame, and the time since the
        posture before. Turning the whole world about the vertical changes nothing. NaN stays within the
        joints that need its node.
        """
        q, rate, rates = self._q, self._rate, self._rates
        q[:-1], rate[:-1] = q_world_from_segment, rate_rad_s
        relative = multiply(conjugate(q.take(self._parents, axis=0)), q_world_from_segment)
        rates[:, :3], rates[:, 3:] = rate_rad_s, rate.take(self._parents, axis=0)
        # 2 q' = q ⊗ ω - ω of the parent ⊗ q, each ω in its own frame
        outer = relative[:, :, None] * rates[:, None, :]
        derivative = outer.reshape(len(rates), 24) @ _DERIVATIVE
        return self._reach.follow(relative, derivative, elapsed_s)


def _derivative() -> Array:
    """(q outer [own rate, parent's rate]) flattened to 24, times this (24, 4), is the derivative of q."""
    structure = np.zeros((4, 6, 4))
    units = np.eye(4)
    for k in range(3):
        structure[:, k] = 0.5 * multiply(units, units[k + 1])
        structure[:, 3 + k] = -0.5 * multiply(units[k + 1], units)
    return structure.reshape(24, 4)


_DERIVATIVE = _derivative()
