"""The angles of a person's joints, whatever a robot can do: the papers' formulas as they stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import IDENTITY, Array, conjugate, multiply, to_matrix
from common.skeleton import Skeleton
from master.joint_angles.angles import intrinsic_angles
from master.joint_angles.rates import angle_rates


class JointAngles:
    """The skeleton's constants, and buffers for one posture at a time.

    Each segment's rotation relative to its neighbour is taken apart about the robot's own joint axes. This
    gives the angles of Zuo, Yu and Gong (2016), Eqs 13 to 24, with their signs and without their arccos.
    A joint that drives several angles follows them by least squares. Nothing is limited and nothing kept
    from one posture to the next: for what a robot is told see `solver.py`.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        count = len(skeleton.segments)
        # row `count` of the buffers is the world: no rotation, no rate
        self._q = np.tile(IDENTITY, (count + 1, 1))
        self._rate = np.zeros((count + 1, 3))
        self._parents = np.where(skeleton.parents < 0, count, skeleton.parents)
        self._frames = skeleton.axis_frames
        self._q_axes = np.empty((count, 4))
        self._vectors = np.empty((count, 3, 3))
        self._both = np.empty((2, 3 * count))
        self._driven, self._weights = _driven_angles(skeleton)

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
        solved: Array = np.einsum("tjk,jk->tj", both.take(self._driven, axis=1), self._weights)
        return solved[0], solved[1]


def _driven_angles(skeleton: Skeleton) -> tuple[NDArray[np.intp], Array]:
    """Each joint's angles: places among the flattened (3, N) of angles.py, and weights; (J, K) each.

    A joint with fewer than K repeats its first with weight 0: a matrix product would spread NaN to all.
    """
    joints, count = len(skeleton.joints), len(skeleton.segments)
    weights = skeleton.joints_from_angles.reshape(joints, count, 3).copy()
    weights[:, :, 2] *= skeleton.axis_handedness
    flat = weights.transpose(0, 2, 1).reshape(joints, 3 * count)
    most = max(len(joint.drives) for joint in skeleton.joints)
    driven = np.empty((joints, most), dtype=np.intp)
    for row, ratios in enumerate(flat):
        places = np.flatnonzero(ratios)
        driven[row] = places[0]
        driven[row, : len(places)] = places
    used = np.arange(most) < [[len(joint.drives)] for joint in skeleton.joints]
    return driven, np.where(used, np.take_along_axis(flat, driven, axis=1), 0.0)
