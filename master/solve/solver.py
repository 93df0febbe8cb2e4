"""From the segments' orientations and rates to the robot's joint positions and velocities."""

from __future__ import annotations

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, multiply, rotate
from common.skeleton import Skeleton
from master.solve.angles import elements, intrinsic_angles
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
        weights = skeleton.joints_from_angles.reshape(joints, count, 3).copy()
        weights[:, :, 2] *= skeleton.axis_handedness
        # (3 N, J), the angles place by place, as angles.py gives them
        self._weights = weights.transpose(2, 1, 0).reshape(3 * count, joints).copy()

    def solve(self, q_world_from_segment: Array, rate_rad_s: Array) -> tuple[Array, Array]:
        """Joint positions (J,) rad and velocities (J,) rad/s.

        Takes orientations (N, 4) and the segments' rates (N, 3), each in its own frame. Turning the whole
        world about the vertical changes nothing. NaN stays within the joints that need its node.
        """
        q, rate = self._q, self._rate
        q[:-1], rate[:-1] = q_world_from_segment, rate_rad_s
        q_segment_from_parent = multiply(conjugate(q_world_from_segment), q.take(self._parents, axis=0))
        relative = rate_rad_s - rotate(q_segment_from_parent, rate.take(self._parents, axis=0))
        # both vectors into each segment's axis frame
        vectors = np.stack([-q_segment_from_parent[:, 1:], relative], axis=1) @ self._frames
        q_axes = self._q_axes
        q_axes[:, 0] = q_segment_from_parent[:, 0]
        q_axes[:, 1:] = vectors[:, 0]
        r = elements(q_axes)
        angles = intrinsic_angles(r)
        rates = angle_rates(r, vectors[:, 1].T)
        both = np.stack([angles.reshape(-1), rates.reshape(-1)]) @ self._weights
        return both[0], both[1]
