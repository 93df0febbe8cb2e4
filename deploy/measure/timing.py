"""Times a call many times over, and sums up the timings by minimum, median and tail."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from common.process.heap import freeze_heap

Figures = dict[str, float]
"""`min`, `median`, `p99`, `max` and `count`."""


def spread(values: Sequence[float]) -> Figures:
    """The summary of some timings, in their own unit; only `count` where there are none."""
    if len(values) == 0:
        return {"count": 0}
    low, median, tail, high = np.percentile(values, [0, 50, 99, 100])
    return {
        "min": round(float(low), 3),
        "median": round(float(median), 3),
        "p99": round(float(tail), 3),
        "max": round(float(high), 3),
        "count": len(values),
    }


def spread_us(durations_ns: Sequence[float]) -> Figures:
    """The summary of durations in ns, in µs."""
    return spread([duration_ns / 1000.0 for duration_ns in durations_ns])


def time_calls(call: Callable[[], object], seconds: float, batch: int = 1) -> Figures:
    """Call again and again for about `seconds`; µs for one call. `batch` calls share one timing."""
    freeze_heap()
    call()
    durations_ns: list[float] = []
    clock = time.perf_counter_ns
    end_ns = clock() + round(seconds * 1e9)
    while (begin_ns := clock()) < end_ns:
        for _ in range(batch):
            call()
        durations_ns.append((clock() - begin_ns) / batch)
    return spread_us(durations_ns)


def total(parts: Iterable[float | None]) -> float | None:
    """The sum, or None where a part is not known."""
    known = list(parts)
    return None if any(part is None for part in known) else sum(part for part in known if part is not None)
