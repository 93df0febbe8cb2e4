"""A site's tighter limits: the nearest posture within them, as the master finds it within the skeleton's.

The master knows the skeleton's limits and keeps them. Where `[guard.joints]` tightens one of a shoulder's,
cutting off each joint by itself would again make another posture of it. So a segment's joints are brought
within the tighter limits together (common/reach). Other joints are left to `limit.py`, which is what holds in
the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.reach import make_follower
from common.skeleton import Skeleton
from common.skeleton.kinematics import relative_orientations
from common.wire.messages import Mask
from slave.guard.events import Clamp, Rule
from slave.guard.limits import MotionLimits

_H_S = 1e-4
"""The step of the central difference that gives the segments' rates."""
_NOTICED_RAD = math.radians(0.1)


class NearestPosture:
    """What the operator's commands become where a limit of several joints of one segment is tightened."""

    def __init__(self, skeleton: Skeleton, limits: MotionLimits) -> None:
        self._skeleton = skeleton
        self._names: Sequence[str] = skeleton.joint_names
        self._reach = make_follower(skeleton, limits.lower_rad, limits.upper_rad, spread=True)
        tighter = (limits.lower_rad > skeleton.lower_rad) | (limits.upper_rad < skeleton.upper_rad)
        self._concerned: Mask = self._reach.joints_beside(tighter)
        self._any = bool(self._concerned.any())
        self._sampled_ns = 0
        self._moved: Mask = np.zeros(len(self._names), np.bool_)

    def forget(self) -> None:
        """The next posture has nothing to do with those before."""
        self._reach.forget()

    def of(
        self, sampled_ns: int, position_rad: Array, velocity_rad_s: Array, valid: Mask
    ) -> tuple[Array, Array]:
        """Position and velocity (J,) to follow for those of a command sampled at a time of any one clock."""
        if not self._any:
            return position_rad, velocity_rad_s
        elapsed_s, self._sampled_ns = to_s(sampled_ns - self._sampled_ns), sampled_ns
        known = np.where(valid, position_rad, np.nan)
        ahead, q, behind = (
            relative_orientations(self._skeleton, known + h * velocity_rad_s) for h in (_H_S, 0.0, -_H_S)
        )
        found, velocity = self._reach.follow(q, (ahead - behind) / (2.0 * _H_S), elapsed_s)
        use = self._concerned & np.isfinite(found)
        return np.where(use, found, position_rad), np.where(use, velocity, velocity_rad_s)

    @property
    def moved(self) -> Mask:
        """(J,) joints that the newest command wants elsewhere than they may go."""
        return self._moved

    def clamps(self, now_ns: int, asked_rad: Array, given_rad: Array) -> list[Clamp]:
        """The joints that are from now on elsewhere than asked."""
        if not self._any:
            return []
        moved = np.abs(asked_rad - given_rad) > _NOTICED_RAD
        fresh, self._moved = moved & ~self._moved, moved
        return [
            Clamp(now_ns, self._names[j], Rule.POSITION, float(asked_rad[j]), float(given_rad[j]))
            for j in np.flatnonzero(fresh).tolist()
        ]
