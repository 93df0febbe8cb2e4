"""The one place that reads a clock: integer nanoseconds, this host's monotonic clock but for recordings."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000

Clock = Callable[[], int]
"""Returns now, in ns of one monotonic clock. Tests pass a virtual one."""

_RAW = getattr(time, "CLOCK_MONOTONIC_RAW", None)
monotonic_ns: Clock = time.perf_counter_ns if _RAW is None else partial(time.clock_gettime_ns, _RAW)
"""The oscillator as it runs. CLOCK_MONOTONIC is steered towards the time of day, by chrony at up to 8 %:
no bound on the offset between two hosts' would be true. Windows' performance counter is not steered."""
wall_ns: Clock = time.time_ns
"""ns since 1970. It jumps when it is set: for recordings and logs only, never to measure by."""


def of_driver_ns(stamp_ns: int) -> int:
    """A driver's stamp of Linux's CLOCK_MONOTONIC, ns, on the clock of `monotonic_ns`.

    The two run apart for as long as the host runs: by 4 s a day where its clock is steered by 50 ppm.
    """
    return stamp_ns + monotonic_ns() - time.monotonic_ns()


def to_ns(seconds: float) -> int:
    """Seconds as integer nanoseconds."""
    return round(seconds * NS_PER_S)


def to_s(nanoseconds: int) -> float:
    """Nanoseconds as seconds."""
    return nanoseconds / NS_PER_S


def to_ms(nanoseconds: float) -> float:
    """Nanoseconds as milliseconds."""
    return nanoseconds / NS_PER_MS
