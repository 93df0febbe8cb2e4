"""The ends of the robot's limbs: what of it reaches farthest, and so moves fastest. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.body import BodyModel

_ENDS = ("left_hand", "right_hand", "left_foot", "right_foot")


class LimbEnds:
    """The far end of each hand and foot that some joint moves; of a robot without them, of its last segments."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._body = BodyModel(skeleton)
        segments = skeleton.segment_names
        moved = (self._body.carries @ np.abs(self._body.hinges_per_joint).T) > 0.0
        parents = {segment.parent for segment in skeleton.segments}
        ends = [i for i, name in enumerate(segments) if name in _ENDS and moved[i].any()]
        self._segments = ends or [i for i, name in enumerate(segments) if name not in parents]
        self.names = tuple(segments[i] for i in self._segments)
        self.moved_by: NDArray[np.bool_] = moved[self._segments]
        """(E, J): whether a joint moves the end."""
        self._local_m = [self._farthest_m(i) for i in self._segments]

    def _farthest_m(self, segment: int) -> Array:
        points = [np.array(c.to_m) for c in self._body.capsules if c.segment == segment]
        return max(points, key=lambda point: float(point @ point))

    def at(self, position_rad: Array) -> Array:
        """(E, 3) m, base frame, for joint angles (J,)."""
        posture = self._body.at(position_rad)
        pairs = zip(self._segments, self._local_m, strict=True)
        return np.array([posture.point_m(segment, local_m) for segment, local_m in pairs])
