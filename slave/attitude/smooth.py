"""A vector's noise taken off by a first-order low-pass: of the readings, never of angles, which wrap."""

from __future__ import annotations

import math

import numpy as np

from common.clock import to_s
from common.quaternion import Array


class Smoother:
    """Follows a vector with a time constant; begins as the plain mean, or the first would count most."""

    def __init__(self, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self._value: Array | None = None
        self._last_ns = 0
        self._taken = 0

    def update(self, value: Array, now_ns: int) -> Array:
        """The smoothed vector after a reading (3,). One that is not finite changes nothing."""
        if not np.isfinite(value).all():
            return np.full(3, np.nan) if self._value is None else self._value
        self._taken += 1
        if self._value is None:
            self._value = np.array(value, dtype=np.float64)
        else:
            past_s = max(to_s(now_ns - self._last_ns), 0.0)
            share = 1.0 if self._time_constant_s == 0.0 else -math.expm1(-past_s / self._time_constant_s)
            self._value = self._value + max(share, 1.0 / self._taken) * (value - self._value)
        self._last_ns = now_ns
        return self._value
