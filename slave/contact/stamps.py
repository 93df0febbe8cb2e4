"""What readings that were taken a little before or after their stamps feign at most. Pure.

A joint that turns at q̇ and is read δ late seems to be q̇ δ farther on: 0.3 ms at 1 rad/s are three counts of
16 bits. The second difference of the momentum takes that for M q̇ δ / Δt².
"""

from __future__ import annotations

import math
from collections import deque
from functools import lru_cache

import numpy as np

from common.quaternion import Array

SETTLED = 12.0
"""After so many time constants nothing is left of a reading: 5e-4 of it."""
_ROUNDED_S = 1e-4
"""Time steps are rounded to this, so that jitter does not ask for new weights."""
_STEPS = 5
"""Of so many steps the shortest counts for the differences, the longest for the poles: stamps make both."""


@lru_cache(maxsize=64)
def weights(share: float, count: int) -> Array:
    """(N,) |h|: the observer's answer to one position that is wrong, N m s²/(kg m²) of it, newest first.

    h is the second difference through three poles that each take in `share` of a step.
    """
    answer = np.zeros(count)
    answer[:3] = (1.0, -2.0, 1.0)
    for _ in range(3):
        level = 0.0
        for k, value in enumerate(answer.tolist()):
            level += share * (value - level)
            answer[k] = level
    return np.abs(answer)


class StampNoise:
    """The torque (J,) that wrong stamps of the last readings can feign together, N m."""

    def __init__(self, joints: int, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self._steps_s: deque[float] = deque(maxlen=_STEPS)
        self._most = np.zeros((0, joints))
        """(N, J) error of each reading's momentum times time, kg m² rad, newest first."""
        self.feigned_nm = np.zeros(joints)
        """(J,) the sum of what each can feign, were all their errors of the worst sign."""

    def add(self, step_s: float, error_s: float, momentum: Array) -> None:
        """A reading `step_s` after the last, whose stamp is wrong by `error_s` at most.

        `momentum` (J,): Σ |M| |q̇|, kg m² rad/s, for the drives' errors need not be alike.
        """
        self._steps_s.append(max(_ROUNDED_S, round(step_s / _ROUNDED_S) * _ROUNDED_S))
        shortest_s, longest_s = min(self._steps_s), max(self._steps_s)
        count = 3 + math.ceil(SETTLED * self._time_constant_s / shortest_s)
        if len(self._most) != count:
            kept, self._most = self._most, np.zeros((count, len(momentum)))
            self._most[: len(kept)] = kept[:count]
        self._most[1:] = self._most[:-1]
        # the velocity over two steps is measured by stamps that are as wrong
        self._most[0] = error_s / max(0.5, 1.0 - error_s / shortest_s) * momentum
        share = -math.expm1(-longest_s / self._time_constant_s)
        self.feigned_nm = weights(share, count) @ self._most / shortest_s**2
