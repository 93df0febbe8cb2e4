"""From the segments' orientations and rates to the robot's joint positions and velocities."""

from __future__ import annotations

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, multiply, to_matrix
from common.skeleton import Skeleton
from master.solve.angles import intrinsic_angles
from master.solve.rates import angle_rates


class JointSolver:
    """The skeleton's constants, and buffers for one posture at a time.

    Each segment's rotation relative to its neighbour is taken apart about the robot's own joint axes. This
    gives the angles of Zuo, Yu and Gong (2016), Eqs 13 to 24, with their signs and without their arccos.
    A joint that drives several angles follows them by least squares.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        count, joints = len(skeleton.segments), len(skeleton.joints)
        # row `count` of the buffers is the world: no rotation, no rate
        self._q = np.tile(IDENTITY, (count + 1, 1))
        self._rate = np.zeros((count + 1, 3))
        self._parents = np.where(skeleton.parents < 0, count, skeleton.parents)
        self._frames = skeleton.axis_frames
        self._q_axes = np.empty((count, 4))
        self._vectors = np.empty((count, 3, 3))
        self._both = np.empty((2, 3 * count))
        weights = skeleton.joints_from_angles.reshape(joints, count, 3).copy()
        weights[:, :, 2] *= skeleton.axis_handedness
        # (3 N, J), the angles place by place, as angles.py gives them
        self._weights = weights.transpose(2, 1, 0).reshape(3 * count, joints).copy()

    def solve(self, q_world_from_segment: Array, rate_rad_s: Array) -> tuple[Array, Array]:
        """Joint positions (J,) rad and velocities (J,) rad/s.

        Takes orientations (N, 4) and the segments' rates (N, 3), each in its own frame. Turning the whole
        world about the vertical changes nothing. NaN stays within the joints that need its node.
        """
        q, rate, vectors, q_axes = self._q, self._rate, self._vectors, self._q_axes
        q[:-1], rate[:-1] = q_world_from_segment, rate_rad_s
        q_parent_from_segment = multiply(conjugate(q.take(self._parents, axis=0)), q_world_from_segment)
        vectors[:, 0] = q_parent_from_segment[:, 1:]
        vectors[:, 1] = rate_rad_s
        vectors[:, 2] = rate.take(self._parents, axis=0)
        # rotation axis, own rate and parent's rate, all into each segment's axis frame
        in_axes = vectors @ self._frames
        q_axes[:, 0] = q_parent_from_segment[:, 0]
        q_axes[:, 1:] = in_axes[:, 0]
        matrix = to_matrix(q_axes)
        relative_rate = in_axes[:, 1] - np.einsum("nji,nj->ni", matrix, in_axes[:, 2])
        both = self._both
        both[0] = intrinsic_angles(matrix).reshape(-1)
        both[1] = angle_rates(matrix, relative_rate).reshape(-1)
        solved: Array = both @ self._weights
        return solved[0], solved[1]
