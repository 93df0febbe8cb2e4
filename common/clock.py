"""The one place that reads a clock: integer nanoseconds, this host's monotonic clock but for recordings."""

from __future__ import annotations

import time
from collections.abc import Callable

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000

Clock = Callable[[], int]
"""Returns now, in ns of one monotonic clock. Tests pass a virtual one."""

monotonic_ns: Clock = time.monotonic_ns
wall_ns: Clock = time.time_ns
"""ns since 1970. It jumps when somebody sets it: for recordings and logs only, never to measure by."""


def to_ns(seconds: float) -> int:
    """Seconds as integer nanoseconds."""
    return round(seconds * NS_PER_S)


def to_s(nanoseconds: int) -> float:
    """Nanoseconds as seconds."""
    return nanoseconds / NS_PER_S


def to_ms(nanoseconds: float) -> float:
    """Nanoseconds as milliseconds."""
    return nanoseconds / NS_PER_MS
