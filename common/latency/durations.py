"""A distribution of durations: exact mean and maximum, percentiles from a histogram. Pure."""

from __future__ import annotations

from collections import deque

from common.clock import NS_PER_MS
from common.latency.histogram import Histogram
from common.metrics.parts import Summary

_LONGEST_US = 60_000_000
MOST_STEPS = 128
MOST_RECENT = 256
"""A second brings a dozen durations, and more only when a link delivers what it held back."""


class Durations:
    """A histogram of durations, 1 µs to 60 s to three digits, beside their exact sum."""

    def __init__(self) -> None:
        self._histogram = Histogram(_LONGEST_US)
        self._sum_ns = 0
        self._max_ns = 0
        self.count = 0
        self.clamped = 0
        """Durations below zero, taken as zero."""

    def record(self, duration_ns: int) -> None:
        """Take one duration."""
        if duration_ns < 0:
            self.clamped += 1
            duration_ns = 0
        self._take(duration_ns, 1)

    def record_missing(self, longest_ns: int, interval_ns: int, count: int) -> None:
        """Take `count` durations, the longest first and each `interval_ns` shorter than the one before.

        So HdrHistogram's `record_corrected_value` fills in what was due while nothing came. Many are taken in
        at most MOST_STEPS values of as many each: the servo loop must not wait for an hour's worth.
        """
        each = -(-count // MOST_STEPS)
        for first in range(0, count, each):
            many = min(each, count - first)
            value_ns = longest_ns - first * interval_ns - (many - 1) * interval_ns // 2
            self._take(max(0, value_ns), many)
        self._max_ns = max(self._max_ns, longest_ns)

    def _take(self, duration_ns: int, count: int) -> None:
        self.count += count
        self._sum_ns += count * duration_ns
        self._max_ns = max(self._max_ns, duration_ns)
        self._histogram.record(min(round(duration_ns / 1000), _LONGEST_US), count)

    def summary(self) -> Summary:
        """Mean and maximum exact, percentiles to three digits."""
        if not self.count:
            return Summary(0)
        p50_us, p99_us = self._histogram.at_percentiles(50, 99)
        return Summary(
            count=self.count,
            mean=self._sum_ns / self.count / NS_PER_MS,
            p50=p50_us / 1000,
            p99=p99_us / 1000,
            max=self._max_ns / NS_PER_MS,
        )


class StreamedDurations(Durations):
    """Durations also published one by one, so that a listener can judge a stretch of time of its own."""

    def __init__(self) -> None:
        super().__init__()
        self._recent_us: deque[int] = deque(maxlen=MOST_RECENT)

    def _take(self, duration_ns: int, count: int) -> None:
        super()._take(duration_ns, count)
        self._recent_us.extend([round(duration_ns / 1000)] * min(count, MOST_RECENT))

    def take_recent(self) -> tuple[int, ...]:
        """Those since the last call in µs, the newest MOST_RECENT of them."""
        recent_us = tuple(self._recent_us)
        self._recent_us.clear()
        return recent_us
