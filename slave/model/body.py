"""Where the robot's segments are for given joint angles, and how every joint moves a point of them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import build_model, unit_rates
from slave.model.capsules import Capsule, capsules, links


@dataclass(frozen=True, slots=True)
class Posture:
    """The robot at some joint angles, in its base frame (the world frame of its table): x ahead, z up."""

    body: BodyModel
    origin_m: Array
    """(N, 3) place of every segment's joint."""
    r_base_from_segment: Array
    """(N, 3, 3)"""
    hinge_axis: Array
    """(H, 3) unit vectors."""
    hinge_m: Array
    """(H, 3) a point on every hinge's axis."""

    def point_m(self, segment: int, local_m: ArrayLike) -> Array:
        """(..., 3) base frame, of points (..., 3) in a segment's own frame."""
        out: Array = self.origin_m[segment] + np.asarray(local_m) @ self.r_base_from_segment[segment].T
        return out

    def ends_m(self, capsule: Capsule) -> tuple[Array, Array]:
        """Both ends of a capsule's line, (3,) each."""
        begin, end = self.point_m(capsule.segment, (capsule.from_m, capsule.to_m))
        return begin, end

    def jacobian(self, segment: int, point_m: Array) -> Array:
        """(3, J): velocity in the base frame, m/s, of a point (3,) fixed to a segment, by each joint's rad/s.

        Column of hinge h between base and segment: a_h x (p - o_h); a joint's is the sum of its hinges'.
        """
        columns = np.cross(self.hinge_axis, point_m - self.hinge_m) * self.body.carries[segment][:, None]
        out: Array = (self.body.hinges_per_joint @ columns).T
        return out


class BodyModel:
    """Forward kinematics, Jacobians and shape of the robot of a table."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.capsules = capsules(skeleton)
        self._model = model = build_model(skeleton)
        self._data = mujoco.MjData(model)
        own = links(skeleton)
        self._bodies = np.array([model.body(link.name).id for link in own])
        self.hinges_per_joint: Array = unit_rates(skeleton, model)
        """(J, H): how every hinge turns for one unit of each joint."""
        place = {link.name: i for i, link in enumerate(own)}
        above = np.eye(len(own), dtype=np.bool_)
        for i, link in enumerate(own):
            if link.parent in place:
                above[i] |= above[place[link.parent]]
        on_segment = model.jnt_bodyid[:, None] == self._bodies
        self.carries: NDArray[np.bool_] = above @ on_segment.T
        """(N, H): whether the hinge moves the segment."""

    def at(self, position_rad: Array) -> Posture:
        """The robot at joint angles (J,)."""
        data = self._data
        data.qpos[:] = position_rad @ self.hinges_per_joint
        mujoco.mj_kinematics(self._model, data)
        turned = data.xmat[self._bodies].reshape(-1, 3, 3)
        return Posture(self, data.xpos[self._bodies], turned, data.xaxis.copy(), data.xanchor.copy())
