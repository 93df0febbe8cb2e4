"""Joints that keep turning about an axis about which they cannot.

The alignment, the zero pose or a heading is wrong then, and the joint holds headings to something wrong.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

MEMORY_S = 10.0
"""Time constant of the mean: a person's skin and a heading still to be found pass sooner."""
BEGINS_RAD, ENDS_RAD = math.radians(25.0), math.radians(15.0)
"""Mean turn from which on a joint is contradicted, and below which no longer."""


class ContradictedJoints:
    """The mean of |h| of M pairs of axes (`constraints.py`), over the time in which both nodes are usable."""

    def __init__(self, count: int) -> None:
        self.mean: Array = np.zeros(count)
        """(M,) of |h|: the sine of how far the axes are from square."""
        self.now: Mask = np.zeros(count, dtype=np.bool_)
        """(M,)."""

    def add(self, error: Array, usable: Mask, dt_s: float) -> None:
        """Take h (M,) of pairs of which both nodes are usable (M,), since the last `dt_s`."""
        share = np.where(usable, -math.expm1(-dt_s / MEMORY_S), 0.0)
        self.mean = self.mean + share * (np.abs(error) - self.mean)
        limit = np.where(self.now, math.sin(ENDS_RAD), math.sin(BEGINS_RAD))
        self.now = self.mean > limit

    def degrees(self, pair: int) -> float:
        """The mean turn of one pair."""
        return math.degrees(math.asin(min(1.0, float(self.mean[pair]))))
