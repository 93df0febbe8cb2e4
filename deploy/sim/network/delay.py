"""How long a packet takes, as a process in time: it wanders, and falls no faster than time passes. Pure."""

from __future__ import annotations

import math
import random

from common.clock import NS_PER_MS

MEMORY = 10.0
"""Correlation time over the jitter. With less the delay would fall faster than packets follow each other, and
those behind would wait for the one ahead: the mean would grow with the packet rate."""
KNOTS = 5
"""Per correlation time; between knots the delay goes straight."""
FORGOTTEN = 50
"""What was so many knots ago says nothing any more."""
TAIL = 2.0
"""The least delay lies so many jitters below the mean, where there is so much."""


class DelayProcess:
    """A delay of given mean and standard deviation, with a floor and a tail towards late.

    A Gaussian process with exponential memory (Ornstein–Uhlenbeck, on a grid), its values mapped to a
    shifted log-normal distribution. Both are usual descriptions of queueing delay. It is a function of time
    and seed alone: with another transport, or strategy, packets that set out at the same time are as late.
    """

    def __init__(self, mean_ms: float, jitter_ms: float, seed: int = 0) -> None:
        self._seed = seed
        self._mean_ns = mean_ms * NS_PER_MS
        self._still = jitter_ms == 0.0
        if self._still:
            return
        self._step_ns = max(round(jitter_ms * MEMORY / KNOTS * NS_PER_MS), 1)
        self._keep = math.exp(-1.0 / KNOTS)
        over_ms = min(TAIL * jitter_ms, mean_ms)
        # a straight line between two knots varies less than its ends do
        spread = jitter_ms / over_ms / math.sqrt((2.0 + self._keep) / 3.0)
        self._sigma = math.sqrt(math.log1p(spread**2))
        self._floor_ns = (mean_ms - over_ms) * NS_PER_MS
        self._scale_ns = over_ms * NS_PER_MS * math.exp(-0.5 * self._sigma**2)
        self._knot = -FORGOTTEN - 2
        self._gauss = 0.0
        self._from_ns = self._to_ns = 0.0

    def at(self, since_ns: int) -> int:
        """The delay of a packet that sets out at that time, ns. Asked with times that do not go back."""
        if self._still:
            return round(self._mean_ns)
        knot, into_ns = divmod(since_ns, self._step_ns)
        if knot - self._knot > FORGOTTEN:
            self._knot, self._gauss = knot - FORGOTTEN, 0.0
        while self._knot < knot:
            self._knot += 1
            self._from_ns, self._to_ns = self._to_ns, self._next()
        return round(self._from_ns + (self._to_ns - self._from_ns) * into_ns / self._step_ns)

    def _next(self) -> float:
        """The delay at the knot after this one."""
        draw = random.Random(self._seed << 40 ^ self._knot).gauss(0.0, 1.0)
        self._gauss = self._keep * self._gauss + math.sqrt(1.0 - self._keep**2) * draw
        return self._floor_ns + self._scale_ns * math.exp(self._sigma * self._gauss)
