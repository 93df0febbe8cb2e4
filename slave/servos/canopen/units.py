"""How each drive's increments are its joint's angle: angle = (increments - zero) / scale. Pure.

A drive that counts over goes from 2³¹ − 1 on to −2³¹. Of all the increments that its 32 bits may stand for,
those nearest the middle of the joint's range count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import limits_rad

_HALF = 2.0**31


@dataclass(frozen=True, slots=True)
class DriveUnits:
    """The conversion between angles and increments for all J drives."""

    scale: Array
    """(J,) increments a radian, signed."""
    zero: Array
    """(J,) increments at angle 0."""
    limits_rad: tuple[tuple[float, float], ...]
    """Software limits by drive."""
    counts_over: Mask
    """(J,) drives whose position goes on beyond its 32 bits."""

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
            np.array([drive.counts_over for drive in drives]),
        )

    def angle_rad(self, increments: NDArray[np.int32]) -> Array:
        """(J,) joint angles at these positions (J,)."""
        position = increments.astype(np.float64)
        if self.counts_over.any():
            middle = self.zero + self.scale * np.mean(self.limits_rad, axis=1)
            position = np.where(self.counts_over, nearest_to(middle, position), position)
        out: Array = (position - self.zero) / self.scale
        return out

    def increments(self, angle_rad: Array) -> Array:
        """(J,) whole increments, still as floats, at these joint angles (J,), as the drives count them."""
        out: Array = np.rint(self.zero + self.scale * angle_rad)
        if self.counts_over.any():
            out = np.where(self.counts_over, counted_over(out), out)
        return out


def counted_over(increments: Array) -> Array:
    """What 32 bits show of whole increments of any size."""
    out: Array = np.mod(increments + _HALF, 2.0 * _HALF) - _HALF
    return out


def nearest_to(middle: Array, shown: Array) -> Array:
    """Of all increments that are shown so, those nearest the middle."""
    return middle + counted_over(shown - middle)
