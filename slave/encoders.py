"""Magnetic rotary encoders at the output shafts (AS5045): 12-bit counts to joint angles and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.skeleton import Skeleton

COUNTS_PER_TURN = 4096
RAD_PER_COUNT = 2.0 * np.pi / COUNTS_PER_TURN
"""Resolution: 0.088°."""

Counts = NDArray[np.int64]


class Encoders:
    """How each joint's encoder is mounted: the count it shows at joint angle 0, and which way it turns.

    An encoder knows its angle within a turn only. Every joint's range is less than a turn, so the
    angle is the one nearest the middle of the range: right within the limits and half the spare
    turn beyond them on either side.
    """

    def __init__(self, skeleton: Skeleton, zero_counts: ArrayLike, directions: ArrayLike) -> None:
        """`zero_counts` (J,) in 0..4095; `directions` (J,) +1, or -1 where counts fall as the angle rises.

        Raises ConfigError naming the joint that cannot be.
        """
        self.zero_counts: Counts = np.array(zero_counts, dtype=np.int64)
        self.directions: Counts = np.array(directions, dtype=np.int64)
        _check(skeleton, self.zero_counts, self.directions)
        middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
        # unwrap in whole counts: exact, so that a count always comes back as itself
        self._first = np.round(middle / RAD_PER_COUNT).astype(np.int64) - COUNTS_PER_TURN // 2

    def position_rad(self, counts: Counts) -> Array:
        """Joint angles (J,) from raw counts (J,), unwrapped into each joint's range."""
        turned = self.directions * (counts - self.zero_counts)
        unwrapped = self._first + (turned - self._first) % COUNTS_PER_TURN
        out: Array = unwrapped.astype(np.float64) * RAD_PER_COUNT
        return out

    def counts(self, position_rad: Array) -> Counts:
        """What the encoders show at joint angles (J,): the nearest count, so within ±0.044°."""
        turned = np.rint(position_rad / RAD_PER_COUNT).astype(np.int64)
        out: Counts = (self.zero_counts + self.directions * turned) % COUNTS_PER_TURN
        return out


def _check(skeleton: Skeleton, zero_counts: Counts, directions: Counts) -> None:
    joints = len(skeleton.joints)
    mistakes = [
        ConfigMistake(key, values.tolist(), f"{joints} values, one a joint")
        for key, values in (("zero_counts", zero_counts), ("directions", directions))
        if values.shape != (joints,)
    ]
    if not mistakes:
        mistakes = list(_joint_mistakes(skeleton, zero_counts.tolist(), directions.tolist()))
    if mistakes:
        raise ConfigError("encoders", mistakes)


def _joint_mistakes(
    skeleton: Skeleton, zero_counts: Sequence[int], directions: Sequence[int]
) -> list[ConfigMistake]:
    mistakes = []
    for joint, zero, direction in zip(skeleton.joints, zero_counts, directions, strict=True):
        if not 0 <= zero < COUNTS_PER_TURN:
            mistakes.append(ConfigMistake(f"{joint.name}.zero_counts", zero, "0 to 4095"))
        if direction not in (1, -1):
            mistakes.append(ConfigMistake(f"{joint.name}.directions", direction, "1 or -1"))
        if joint.upper_rad - joint.lower_rad >= 2.0 * np.pi - 2.0 * RAD_PER_COUNT:
            span = f"{np.rad2deg(joint.upper_rad - joint.lower_rad):.1f}°"
            mistakes.append(ConfigMistake(f"{joint.name} range", span, "less than a turn"))
    return mistakes
