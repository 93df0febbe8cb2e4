"""Segments that bear no node: they go with the segment that bears them, or their joints keep still. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array, heading_turn
from common.skeleton import Skeleton
from common.wire.messages import Mask


class SegmentsWithoutNode:
    """What stands for the orientations of segments without a node, and for the joints that need them."""

    def __init__(self, skeleton: Skeleton, without: Mapping[str, str], facing_rad: float) -> None:
        """`without`: `parent` or `neutral` by segment. `facing_rad`: where a root without a node faces."""
        self._facing = heading_turn(facing_rad)
        index = {name: i for i, name in enumerate(skeleton.segment_names)}
        absent = sorted(index[name] for name in without)
        # a parent stands before its children, so that one pass is enough
        self._pairs = [(i, int(skeleton.parents[i])) for i in absent]
        neutral = np.array([without.get(name) == "neutral" for name in skeleton.segment_names])
        self._lower_rad, self._upper_rad = skeleton.lower_rad, skeleton.upper_rad
        owns = (skeleton.angles_from_joints.reshape(len(skeleton.segments), 3, -1) ** 2).sum(axis=1)
        missing = np.isin(np.arange(len(index)), absent)
        weight, unseen = owns.sum(axis=0), owns[missing].sum(axis=0)
        self.still: Mask = (unseen == weight) & (owns[neutral].sum(axis=0) == weight)
        """(J,) joints kept at zero, or at the limit nearest to it: all their segments are neutral."""
        # a finger's joint stands for several segments: those that have nodes speak for the others
        seen = (unseen > 0.0) & (unseen < weight)
        self._scale = np.where(seen, weight / np.where(seen, weight - unseen, 1.0), 1.0)
        self._coupled: NDArray[np.intp] = np.flatnonzero(seen)

    def fill(self, q: Array, rate_rad_s: Array, valid: Mask) -> tuple[Array, Array, Mask]:
        """Orientations (N, 4), rates (N, 3) in each segment's frame and validity (N,) of all segments."""
        if not self._pairs:
            return q, rate_rad_s, valid
        q, rate_rad_s, valid = q.copy(), rate_rad_s.copy(), valid.copy()
        for segment, parent in self._pairs:
            if parent < 0:
                q[segment], rate_rad_s[segment], valid[segment] = self._facing, 0.0, True
            else:
                q[segment], rate_rad_s[segment], valid[segment] = q[parent], rate_rad_s[parent], valid[parent]
        return q, rate_rad_s, valid

    def settle(self, position_rad: Array, velocity_rad_s: Array) -> tuple[Array, Array]:
        """Joint angles and rates (J,) of which some segments have no node."""
        if len(self._coupled):
            position_rad = np.clip(position_rad * self._scale, self._lower_rad, self._upper_rad)
            velocity_rad_s = velocity_rad_s * self._scale
        if self.still.any():
            position_rad = np.where(self.still, np.clip(0.0, self._lower_rad, self._upper_rad), position_rad)
            velocity_rad_s = np.where(self.still, 0.0, velocity_rad_s)
        return position_rad, velocity_rad_s
