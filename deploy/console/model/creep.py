"""Whether latency creeps up over ten minutes, long before any gate refuses a command. Pure.

The slope is the median of the slopes between all pairs of blocks (Theil 1950, Sen 1968): a few late
commands do not move it. Its confidence interval is from Kendall's statistic (Sen 1968): of N sorted slopes
those with the ranks (N ± C) / 2, where C = z sqrt(n (n - 1) (2 n + 5) / 18) for n blocks. A block is the
median of 30 s, so that what neighbouring seconds share counts once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from common.clock import NS_PER_S

WINDOW_S = 600
BLOCK_S = 30
_BLOCKS = WINDOW_S // BLOCK_S
_FEWEST = 15
"""Blocks below which nothing is said."""
_FEWEST_IN_BLOCK = 10
"""Seconds of a block that must be known."""
_Z = 2.576
"""99 %, two-sided."""
CONFIDENCE_PERCENT = 99
LEAST_MS = 5.0
"""A rise over the window below this, or below `LEAST_SHARE` of the median, alarms nobody."""
LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Creep:
    """The slope of latency over the last ten minutes, ms a minute, with its confidence interval."""

    slope: float
    low: float
    high: float
    median_ms: float
    blocks: int

    @property
    def rise_ms(self) -> float:
        """Over the window."""
        return self.slope * WINDOW_S / 60.0

    @property
    def alarm(self) -> bool:
        """Whether it rises for certain, and by enough to matter."""
        return self.low > 0.0 and self.rise_ms >= max(LEAST_MS, LEAST_SHARE * self.median_ms)

    @property
    def words(self) -> str:
        """For people; empty without an alarm."""
        if not self.alarm:
            return ""
        return (
            f"latency rises by {self.slope:.2f} ms a minute ({self.low:.2f} to {self.high:.2f}, "
            f"{CONFIDENCE_PERCENT} % confidence): {self.rise_ms:.0f} ms in ten minutes"
        )

    def shown(self) -> dict[str, object]:
        """As the page has it."""
        return {
            "alarm": self.alarm,
            "ms_per_min": round(self.slope, 3),
            "low": round(self.low, 3),
            "high": round(self.high, 3),
            "words": self.words,
        }


class CreepWatch:
    """Takes the median of each second."""

    def __init__(self) -> None:
        self._seconds: dict[int, list[float]] = {}
        """By block."""
        self.newest: Creep | None = None
        """None while too little is known."""

    def add(self, second: int, value_ms: float) -> None:
        """The median of a second, whose number grows by one each second."""
        block = second // BLOCK_S
        began = block not in self._seconds
        self._seconds.setdefault(block, []).append(value_ms)
        if began:
            self._seconds = {b: v for b, v in self._seconds.items() if block - _BLOCKS <= b <= block}
            self.newest = self._judge(block)

    def look(self, now_ns: int) -> Creep | None:
        """The newest, as long as it is not old."""
        block = now_ns // NS_PER_S // BLOCK_S
        return self.newest if self._seconds and block - max(self._seconds) <= 2 else None

    def _judge(self, current: int) -> Creep | None:
        whole = {
            block: median(values)
            for block, values in self._seconds.items()
            if block != current and len(values) >= _FEWEST_IN_BLOCK
        }
        if len(whole) < _FEWEST:
            return None
        return theil_sen(list(whole), list(whole.values()))


def theil_sen(blocks: list[int], values_ms: list[float]) -> Creep:
    """The creep of blocks at these places. At least three."""
    n = len(blocks)
    at_min = np.array(blocks) * (BLOCK_S / 60.0)
    values = np.array(values_ms)
    first, second = np.triu_indices(n, 1)
    slopes = np.sort((values[second] - values[first]) / (at_min[second] - at_min[first]))
    c = _Z * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low = max(0, math.floor((len(slopes) - c) / 2.0))
    high = min(len(slopes) - 1, math.ceil((len(slopes) + c) / 2.0))
    return Creep(
        float(np.median(slopes)), float(slopes[low]), float(slopes[high]), float(np.median(values)), n
    )
