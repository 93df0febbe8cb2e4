"""How each drive's increments are its joint's angle: angle = (increments - zero) / scale. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import limits_rad


@dataclass(frozen=True, slots=True)
class DriveUnits:
    """The conversion between angles and increments for all J drives."""

    scale: Array
    """(J,) increments a radian, signed."""
    zero: Array
    """(J,) increments at angle 0."""
    limits_rad: tuple[tuple[float, float], ...]
    """Software limits by drive."""

    @classmethod
    def of(cls, config: CanopenConfig, skeleton: Skeleton) -> DriveUnits:
        """The units that the file configures."""
        drives = config.drives_of(skeleton).values()
        return cls(
            np.array([drive.increments_per_rad for drive in drives]),
            np.array([drive.zero_increments for drive in drives], dtype=np.float64),
            tuple(
                limits_rad(drive, joint.lower_rad, joint.upper_rad)
                for drive, joint in zip(drives, skeleton.joints, strict=True)
            ),
        )

    def angle_rad(self, increments: NDArray[np.int32]) -> Array:
        """(J,) joint angles at these positions (J,)."""
        out: Array = (increments - self.zero) / self.scale
        return out

    def increments(self, angle_rad: Array) -> Array:
        """(J,) whole increments, still as floats, at these joint angles (J,)."""
        out: Array = np.rint(self.zero + self.scale * angle_rad)
        return out
