"""An absolute tick grid: a late loop skips to the newest tick and counts what it missed; it never bursts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DueTick:
    """The tick to run now, and how many were skipped to get to it."""

    tick: int
    scheduled_ns: int
    missed: int


class TickGrid:
    """Ticks at `origin_ns + tick * period_ns`; tick 0 is the first."""

    def __init__(self, origin_ns: int, period_ns: int) -> None:
        if period_ns <= 0:
            raise ValueError(f"period_ns must be positive, not {period_ns}")
        self.origin_ns = origin_ns
        self.period_ns = period_ns
        self._next = 0

    @property
    def next_ns(self) -> int:
        """When the next tick falls due."""
        return self.origin_ns + self._next * self.period_ns

    def due(self, now_ns: int) -> DueTick | None:
        """The newest tick that has fallen due and not been run, or None if it is too early."""
        newest = (now_ns - self.origin_ns) // self.period_ns
        if newest < self._next:
            return None
        missed = newest - self._next
        self._next = newest + 1
        return DueTick(newest, self.origin_ns + newest * self.period_ns, missed)
