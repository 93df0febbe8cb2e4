"""The zero pose taken again, of a suit that is worn: until it is good the old one stays.

The headings of all nodes are taken anew, and the alignment of those that had it from a zero pose. Because the
old pose is known, a lean is noticed of every node, also of one without a calibrated alignment.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from master.orientation.zero_pose import ZeroPose


class ZeroPoseAgain:
    """Takes one pose of the nodes that are heard; nodes that are not keep what they had."""

    def __init__(self, pose: ZeroPose) -> None:
        """`pose` is empty, and checks the lean of every node."""
        self._pose = pose
        self.taken: Mask = np.zeros_like(pose.known)
        """(N,) nodes of which the new pose is complete; none until it is of all that are heard."""

    def add(self, q_world_from_sensor: Array, settled: Mask, rate_rad_s: Array) -> bool:
        """One tick, as of `ZeroPose.add`; True once the pose is complete."""
        self._pose.add(q_world_from_sensor, settled, rate_rad_s)
        known = self._pose.known
        if not known.any() or (settled & ~known).any():
            return False
        self.taken = known.copy()
        return True

    @property
    def q_sensor_from_segment(self) -> Array:
        """(N, 4), of the nodes `taken`."""
        return self._pose.q_sensor_from_segment

    @property
    def moved_rad(self) -> Array:
        """(N,) how far the headings of the nodes `taken` were from the pose, about the vertical."""
        return self._pose.correction_rad

    def words(self, names: tuple[str, ...]) -> str:
        """What was wrong with the newest pose, the worst node first; empty where nothing was."""
        for node, why in self._pose.reasons.items():
            return f"{names[node]} {why}"
        return ""


def spread_deg(moved_rad: Array) -> Array:
    """How far headings (N,) moved apart: all turn alike if the operator faces elsewhere than before."""
    middle = math.atan2(np.sin(moved_rad).sum(), np.cos(moved_rad).sum())
    apart = (moved_rad - middle + math.pi) % (2.0 * math.pi) - math.pi
    out: Array = np.degrees(apart - np.median(apart))
    return out
