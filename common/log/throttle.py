"""How often a fault that repeats itself is logged."""

from __future__ import annotations

from collections.abc import Hashable

from common.clock import NS_PER_S


class LogThrottle:
    """Lets each kind of line through once a period, and counts those that it held back."""

    def __init__(self, period_ns: int = NS_PER_S) -> None:
        self._period_ns = period_ns
        self._passed_ns: dict[Hashable, int] = {}
        self._held_back: dict[Hashable, int] = {}

    def passes(self, now_ns: int, kind: Hashable = None) -> int:
        """0: do not log. n ≥ 1: log now, for n occurrences, this one included."""
        occurrences = self._held_back.get(kind, 0) + 1
        passed_ns = self._passed_ns.get(kind)
        if passed_ns is not None and now_ns - passed_ns < self._period_ns:
            self._held_back[kind] = occurrences
            return 0
        self._passed_ns[kind] = now_ns
        self._held_back[kind] = 0
        return occurrences
