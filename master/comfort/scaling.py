"""Motion scaled by joint group: the robot's joints turn by a written share of what the operator's turn. Pure.

    q' = a + f (q - a),   q̇' = f q̇

The anchor a is the operator's posture when the robot began to follow: the engage, or the take-up of a group
that rested. Until then a follows the operator and q' = q: a scaled robot aligns to the very posture in which
its operator engages, and no target jumps when the factor begins to count. For 0 < f ≤ 1, q' lies between a
and q: where these are within the joints' limits, q' is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from common.errors import ConfigMistake
from common.quaternion import Array
from common.skeleton import Skeleton
from common.skeleton.groups import joint_groups
from common.wire.messages import Mask

FOLLOWING = frozenset({"align", "track"})
"""The guard's states in which the robot goes where the operator is."""


def scaling_mistakes(factors: Mapping[str, float], skeleton: Skeleton) -> list[ConfigMistake]:
    """Groups that the profile does not have."""
    groups = joint_groups(skeleton)
    expected = f"a joint group of {skeleton.name}: {', '.join(groups)}"
    return [
        ConfigMistake(f"operator.scaling.{n}", f, expected) for n, f in factors.items() if n not in groups
    ]


class MotionScaling:
    """The factors of one robot's joints, and the posture about which they scale."""

    def __init__(self, factors: Mapping[str, float], skeleton: Skeleton) -> None:
        """A group within another has its own factor: the hand's counts, and not its arm's."""
        self.factors = dict(factors)
        self._groups = joint_groups(skeleton)
        self._factor = np.ones(len(skeleton.joints))
        for name in sorted(factors, key=lambda name: -int(self._groups[name].sum())):
            self._factor[self._groups[name]] = factors[name]
        self._anchor_rad: Array = np.full(len(skeleton.joints), np.nan)
        self._following: Mask = np.zeros(len(skeleton.joints), np.bool_)

    def on_state(self, guard: str, resting: Sequence[str]) -> None:
        """Take what the robot says of itself: its guard's state, and the groups that rest."""
        if not self.factors:
            return
        following = np.full(len(self._factor), guard in FOLLOWING)
        for name in resting:
            if name in self._groups:
                following &= ~self._groups[name]
        self._following = following

    def scale(self, position_rad: Array, velocity_rad_s: Array, valid: Mask) -> tuple[Array, Array]:
        """Position and velocity (J,) to command for the operator's; what is not `valid` stays as it is."""
        if not self.factors:
            return position_rad, velocity_rad_s
        moves_anchor = valid & ~(self._following & np.isfinite(self._anchor_rad))
        self._anchor_rad = np.where(moves_anchor, position_rad, self._anchor_rad)
        scaled = valid & self._following & (self._factor != 1.0)
        anchor = np.where(scaled, self._anchor_rad, 0.0)
        position = np.where(scaled, anchor + self._factor * (position_rad - anchor), position_rad)
        return position, np.where(scaled, self._factor * velocity_rad_s, velocity_rad_s)
