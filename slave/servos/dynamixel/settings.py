"""The settings that each servo gets before it may be used. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.skeleton import Skeleton
from slave.encoders.counts import COUNTS_PER_TURN, RAD_PER_COUNT, Encoders
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.config import WATCHDOG_UNIT_S, DynamixelConfig
from slave.servos.dynamixel.registers import Register

_MARGIN = round(math.radians(3.0) / RAD_PER_COUNT)
"""Servos stop this far outside the table's limits, so that the guard's limits are the ones that are met."""
_HEADROOM = 1.25
"""A servo's own velocity limit over the table's: it catches what should never be written."""


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of one joint's servo."""

    joint: str
    id: int
    lowest: int
    """Least position, counts, that the servo goes to."""
    highest: int
    velocity: int
    """PROFILE_VELOCITY."""
    watchdog: int
    """BUS_WATCHDOG."""

    @property
    def lasting(self) -> tuple[tuple[Register, int], ...]:
        """Kept by the servo without power; can be changed only while its torque is off."""
        return (
            (x.RETURN_DELAY, 0),
            (x.DRIVE_MODE, 0),
            (x.OPERATING_MODE, x.POSITION_MODE),
            (x.HOMING_OFFSET, 0),
            (x.MAX_POSITION, self.highest),
            (x.MIN_POSITION, self.lowest),
        )

    @property
    def passing(self) -> tuple[tuple[Register, int], ...]:
        """Lost with the power; the watchdog's stop sets the profile to 0 as well."""
        return ((x.PROFILE_ACCELERATION, 0), (x.PROFILE_VELOCITY, self.velocity))


def settings_of(config: DynamixelConfig, skeleton: Skeleton, encoders: Encoders) -> list[Settings]:
    """The settings of all joints, in the skeleton's order. The configuration must be free of mistakes."""
    ends = np.sort(
        np.stack([encoders.counts(skeleton.lower_rad), encoders.counts(skeleton.upper_rad)]), axis=0
    )
    watchdog = round(config.bus_watchdog_s / WATCHDOG_UNIT_S)
    return [
        Settings(
            joint.name,
            config.ids[joint.name],
            lowest=max(0, int(low) - _MARGIN),
            highest=min(COUNTS_PER_TURN - 1, int(high) + _MARGIN),
            velocity=x.profile_velocity(_HEADROOM * joint.max_velocity_rad_s),
            watchdog=watchdog,
        )
        for joint, low, high in zip(skeleton.joints, ends[0], ends[1], strict=True)
    ]
