"""One-way times in buckets, as a histogram of Prometheus: any window has its own percentiles. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

from deploy.ops.metrics.table import BUCKETS_S


@dataclass(frozen=True, slots=True)
class OneWayBuckets:
    """Counts since this process began; they only grow."""

    counts: tuple[int, ...] = (0,) * len(BUCKETS_S)
    sum_s: float = 0.0

    @property
    def count(self) -> int:
        """Of all times."""
        return sum(self.counts)

    def with_more(self, times_us: Iterable[int]) -> OneWayBuckets:
        """With these times too."""
        counts, sum_s = list(self.counts), self.sum_s
        for time_us in times_us:
            counts[bisect_left(BUCKETS_S, time_us / 1e6)] += 1
            sum_s += time_us / 1e6
        return OneWayBuckets(tuple(counts), sum_s)

    def cumulative(self) -> list[tuple[str, int]]:
        """Each upper edge as Prometheus writes it, and how many are no longer than that."""
        edges = ["+Inf" if edge == float("inf") else f"{edge:g}" for edge in BUCKETS_S]
        return list(zip(edges, accumulate(self.counts), strict=True))
