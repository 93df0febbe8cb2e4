"""What watched robots cost as a fixed part and one for each: cost(N) = fixed + each · N. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

LEAST_SIZES = 3
"""Sizes of fleets without which no line is judged: two lie on one by themselves."""


@dataclass(frozen=True, slots=True)
class WatchingCost:
    """The line, in percent of a core."""

    fixed_percent: float
    """The first robots': waking for each message, where later ones come together."""
    each_percent: float
    furthest_percent: float
    """By how much the measured cost that is furthest from the line differs from it, in % of the line."""


def watching_cost(percent_by_robots: Mapping[int, float]) -> WatchingCost | None:
    """The line with the least relative squares through the costs by the number of robots (1 and more).

    None with fewer than LEAST_SIZES sizes, or where a cost is not above zero.
    """
    points = sorted((count, cost) for count, cost in percent_by_robots.items() if count > 0)
    if len(points) < LEAST_SIZES or min(cost for _, cost in points) <= 0.0:
        return None
    robots, cost = np.array(points, dtype=np.float64).T
    # each row divided by its cost: a deviation counts in percent, for ten robots as for a thousand
    rows = np.column_stack([np.ones_like(robots), robots]) / cost[:, None]
    (fixed, each), *_ = np.linalg.lstsq(rows, np.ones_like(cost), rcond=None)
    line = fixed + each * robots
    if (line <= 0.0).any():
        return None
    furthest = float(np.abs(cost / line - 1.0).max())
    return WatchingCost(float(fixed), float(each), 100.0 * furthest)
