"""Whether a robot stands, by its encoders alone. Pure."""

from __future__ import annotations

from collections import deque

import numpy as np

from common.clock import to_ns
from common.quaternion import Array

WINDOW_S = 0.3
SLOWEST_RAD_S = float(np.radians(0.5))
_FEWEST = 5
"""Readings in the window, below which nothing is known."""


class Standstill:
    """Stands: over the last `WINDOW_S` no joint went further than `SLOWEST_RAD_S` would take it."""

    def __init__(self) -> None:
        self._readings: deque[tuple[int, Array]] = deque(maxlen=512)

    def add(self, read_ns: int, position_rad: Array) -> None:
        """Take a reading (J,), read at `read_ns` of the robot's clock; older than the newest: ignored."""
        if self._readings and read_ns <= self._readings[-1][0]:
            if self._readings[-1][0] - read_ns > to_ns(WINDOW_S):
                self._readings.clear()  # the robot's clock began anew
            else:
                return
        self._readings.append((read_ns, position_rad))

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
        moved_rad = np.ptp(np.array(window), axis=0)
        known = moved_rad[np.isfinite(moved_rad)]
        return bool(known.size) and float(known.max()) < SLOWEST_RAD_S * WINDOW_S
