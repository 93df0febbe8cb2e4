"""Magnetic rotary encoders at the output shafts (AS5045): 12-bit counts to joint angles and back."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from common.config.section import Section
from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.skeleton import Skeleton

COUNTS_PER_TURN = 4096
RAD_PER_COUNT = 2.0 * np.pi / COUNTS_PER_TURN
"""Resolution: 0.088°."""
_TURN_MASK = COUNTS_PER_TURN - 1
"""Modulo a turn, also of negative counts."""

Counts = NDArray[np.int64]


class EncoderConfig(Section):
    """`[encoders]`: how they are mounted; a joint that is not named has zero count 0 and is not reversed."""

    zero_counts: dict[str, Annotated[int, Field(ge=0, lt=COUNTS_PER_TURN)]] = Field(default_factory=dict)
    """The raw count, 0..4095, that a joint's encoder shows at joint angle 0."""
    reversed: list[str] = Field(default_factory=list)
    """Joints whose counts fall as the angle rises."""

    def mistakes_for(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """Joints that the robot does not have, and joints that turn too far for one encoder."""
        named = [(f"encoders.zero_counts.{name}", name) for name in self.zero_counts]
        named += [("encoders.reversed", name) for name in self.reversed]
        mistakes = [
            ConfigMistake(key, name, f"a joint of the {skeleton.name} profile")
            for key, name in named
            if name not in skeleton.joint_names
        ]
        return mistakes + [
            ConfigMistake(f"{joint.name}.range", f"{np.rad2deg(span):.1f}°", "less than a turn")
            for joint in skeleton.joints
            if (span := joint.upper_rad - joint.lower_rad) >= 2.0 * np.pi - 2.0 * RAD_PER_COUNT
        ]


class Encoders:
    """Counts to joint angles and back, for all joints of a robot at once.

    An encoder knows its angle within a turn only. Every joint's range is less than a turn, so the
    angle is the one nearest the middle of the range: right within the limits, and beyond them by
    half of what is left of the turn on either side.
    """

    def __init__(self, skeleton: Skeleton, config: EncoderConfig | None = None) -> None:
        """Raises ConfigError naming the joint that cannot be."""
        config = config or EncoderConfig()
        mistakes = config.mistakes_for(skeleton)
        if mistakes:
            raise ConfigError("encoders", mistakes)
        names = skeleton.joint_names
        self._zero = np.array([config.zero_counts.get(name, 0) for name in names], dtype=np.int64)
        self._direction = np.array([-1 if n in config.reversed else 1 for n in names], dtype=np.int64)
        self._counts_per_rad = self._direction / RAD_PER_COUNT
        middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
        # unwrapped in whole counts, which is exact: a count always comes back as itself
        self._lowest = np.rint(middle / RAD_PER_COUNT).astype(np.int64) - COUNTS_PER_TURN // 2
        self._lowest_shown = self._direction * self._zero + self._lowest

    def position_rad(self, counts: Counts) -> Array:
        """Joint angles (J,) from raw counts (J,), unwrapped into each joint's range."""
        unwrapped = self._lowest + (self._direction * counts - self._lowest_shown & _TURN_MASK)
        out: Array = unwrapped.astype(np.float64) * RAD_PER_COUNT
        return out

    def counts(self, position_rad: Array) -> Counts:
        """What the encoders show at joint angles (J,): the nearest count, so within ±0.044°."""
        turned = np.rint(position_rad * self._counts_per_rad).astype(np.int64)
        out: Counts = self._zero + turned & _TURN_MASK
        return out
