"""What a time service states of this host's clock, carried onto the clock that tandem counts by. Pure.

tandem counts by CLOCK_MONOTONIC_RAW, which nobody steers. A service states how far the system clock (or a PTP
hardware clock) is from its reference T, and how wrong that may be. Both clocks are read at one moment, so
that `ahead` = T − RAW is known within ± error. From then on it ages: by the rate that was seen before, and by
what an oscillator may do besides.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from common.clock import NS_PER_S
from common.wire.messages import ClockReference

OSCILLATOR_PPB = 250_000
"""The most that one oscillator is wrong: half of `RAW_CLOCKS`."""
WANDER_PPB = 20_000
"""By how much its rate may change from what was seen."""
RATE_FROM_NS = 8 * NS_PER_S
KEPT = 64
SETTLE_NS = 10 * NS_PER_S
"""After a step nothing is stated for so long."""
OLD_NS = 15 * NS_PER_S
"""A statement of that age is no longer used: its service has fallen silent."""
DAY_NS = 86_400 * NS_PER_S
LEAP_NS = 60 * NS_PER_S
"""So near to midnight nothing is stated while a leap second is announced."""


@dataclass(frozen=True, slots=True)
class Statement:
    """What a service said at one moment."""

    at_ns: int
    """tandem's clock."""
    ahead_ns: int
    """The service's reference minus tandem's clock."""
    error_ns: int
    """Half-width: the service's own, and that of reading the clocks."""
    source: str
    """`chrony` or `ptp`."""
    scale: str
    """What the reference counts: `utc`, or a PTP grandmaster of its own. Only equal ones compare."""
    leaps: bool = False
    """Whether a leap second is announced."""


class ReferenceTrack:
    """Statements one after the other: their rate, their steps, and what may be told to the other host."""

    def __init__(self) -> None:
        self.steps = 0
        """Times that a statement contradicted the one before: the clock was set, or a leap second passed."""
        self._seen: deque[Statement] = deque(maxlen=KEPT)
        self._settles_ns: int | None = None

    def take(self, stated: Statement) -> None:
        """Take the newest statement."""
        before = self._seen[-1] if self._seen else None
        if before is not None and (before.source, before.scale) != (stated.source, stated.scale):
            self._seen.clear()
        elif before is not None and self._contradicts(before, stated):
            self.steps += 1
            self._seen.clear()
            self._settles_ns = stated.at_ns + SETTLE_NS
        self._seen.append(stated)

    def silent(self) -> None:
        """The service states nothing now."""
        self._seen.clear()

    def reference(self, now_ns: int) -> ClockReference | None:
        """What to tell the other host; None where nothing may be."""
        if not self._seen or now_ns - self._seen[-1].at_ns > OLD_NS:
            return None
        newest = self._seen[-1]
        if self._settles_ns is not None and newest.at_ns < self._settles_ns:
            return None
        if newest.leaps and near_midnight(newest.at_ns + newest.ahead_ns):
            return None
        rate_ppb, error_ppb = self._rate()
        return ClockReference(
            newest.at_ns, newest.ahead_ns, newest.error_ns, rate_ppb, error_ppb, newest.source, newest.scale
        )

    def _rate(self) -> tuple[int, int]:
        oldest, newest = self._seen[0], self._seen[-1]
        span_ns = newest.at_ns - oldest.at_ns
        if span_ns < RATE_FROM_NS:
            return 0, OSCILLATOR_PPB
        rate_ppb = round((newest.ahead_ns - oldest.ahead_ns) * 1e9 / span_ns)
        by_error_ppb = round((newest.error_ns + oldest.error_ns) * 1e9 / span_ns)
        if by_error_ppb + WANDER_PPB >= OSCILLATOR_PPB + abs(rate_ppb):
            return 0, OSCILLATOR_PPB
        return rate_ppb, by_error_ppb + WANDER_PPB

    @staticmethod
    def _contradicts(before: Statement, stated: Statement) -> bool:
        apart_ns = abs(stated.ahead_ns - before.ahead_ns)
        aged_ns = abs(stated.at_ns - before.at_ns) * OSCILLATOR_PPB // 10**9
        return apart_ns > stated.error_ns + before.error_ns + aged_ns


def near_midnight(utc_ns: int) -> bool:
    """Whether a leap second may pass within LEAP_NS."""
    return min(utc_ns % DAY_NS, -utc_ns % DAY_NS) <= LEAP_NS


def interval_at(reference: ClockReference, at_ns: int, within_ns: int = 0) -> tuple[int, int]:
    """Limits of the reference minus that host's clock, at `at_ns` of it, known to ± `within_ns`.

    In whole ns: since 1970 there are more of them than a float can tell apart.
    """
    since_ns = at_ns - reference.at_ns
    middle_ns = reference.ahead_ns + reference.rate_ppb * since_ns // 10**9
    aged = reference.rate_error_ppb * (abs(since_ns) + within_ns) + abs(reference.rate_ppb) * within_ns
    half_ns = reference.error_ns + aged // 10**9 + 2
    return middle_ns - half_ns, middle_ns + half_ns
