"""What each joint may do at most: the skeleton's limits, tightened by `[guard]`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What each joint may do at most, (J,) each."""

    lower_rad: Array
    upper_rad: Array
    max_velocity_rad_s: Array
    max_acceleration_rad_s2: Array

    def reachable(self, position_rad: Array) -> Array:
        """Positions (J,) brought within the position limits."""
        out: Array = np.minimum(np.maximum(position_rad, self.lower_rad), self.upper_rad)
        return out
