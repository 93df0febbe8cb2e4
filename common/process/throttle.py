"""Say a thing that keeps happening at most once a period."""

from __future__ import annotations

from common.clock import NS_PER_S


class Throttle:
    """Lets the first through, then one a period."""

    def __init__(self, period_ns: int = NS_PER_S) -> None:
        self._period_ns = period_ns
        self._next_ns: int | None = None

    def passes(self, now_ns: int) -> bool:
        """True if it may be said now."""
        if self._next_ns is not None and now_ns < self._next_ns:
            return False
        self._next_ns = now_ns + self._period_ns
        return True
