"""Whether a robot stands, by its encoders alone. Pure."""

from __future__ import annotations

from collections import deque

import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask

WINDOW_S = 0.3
SLOWEST_RAD_S = float(np.radians(0.5))
_FEWEST = 5
"""Readings in the window, below which nothing is known."""


class Standstill:
    """Stands: over the last `WINDOW_S` no joint went further than `SLOWEST_RAD_S` would take it.

    Joints whose encoders were not valid all that time are left out; where all are, nothing is known.
    """

    def __init__(self) -> None:
        self._readings: deque[tuple[int, Array]] = deque(maxlen=512)

    def add(self, read_ns: int, position_rad: Array, valid: Mask) -> bool:
        """Take a reading (J,), read at `read_ns` of the robot's clock; False where it is not newer: ignored.

        An encoder that is not `valid` (J,) repeats its last value, which proves nothing.
        """
        if self._readings and read_ns <= self._readings[-1][0]:
            if self._readings[-1][0] - read_ns > to_ns(WINDOW_S):
                self._readings.clear()  # the robot's clock began anew
            else:
                return False
        self._readings.append((read_ns, np.where(valid, position_rad, np.nan)))
        return True

    @property
    def stands(self) -> bool:
        """By the newest readings; False while there are too few."""
        if not self._readings:
            return False
        newest_ns = self._readings[-1][0]
        window = []
        reached = False
        for read_ns, position_rad in reversed(self._readings):
            window.append(position_rad)
            reached = newest_ns - read_ns >= to_ns(WINDOW_S)
            if reached:
                break
        if not reached or len(window) < _FEWEST:
            return False
        positions_rad = np.array(window)
        known = np.isfinite(positions_rad)
        if not (known.all(axis=0) | ~known.any(axis=0)).all():
            return False  # an encoder came or went: where that joint was meanwhile, nobody knows
        moved_rad = np.ptp(positions_rad[:, known.any(axis=0)], axis=0)
        return bool(moved_rad.size) and float(moved_rad.max()) < SLOWEST_RAD_S * WINDOW_S
