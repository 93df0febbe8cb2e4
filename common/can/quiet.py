"""How seldom a fault that repeats itself is told."""

from __future__ import annotations

from common.clock import NS_PER_S


class OncePerSecond:
    """Lets each key speak once a second; says how many times it was asked since it last spoke."""

    def __init__(self, period_ns: int = NS_PER_S) -> None:
        self._period_ns = period_ns
        self._spoke_ns: dict[str, int] = {}
        self._held: dict[str, int] = {}

    def ask(self, key: str, now_ns: int) -> int:
        """0: keep quiet. n ≥ 1: speak now, for n occurrences, this one included."""
        held = self._held.get(key, 0) + 1
        spoke_ns = self._spoke_ns.get(key)
        if spoke_ns is not None and now_ns - spoke_ns < self._period_ns:
            self._held[key] = held
            return 0
        self._spoke_ns[key] = now_ns
        self._held[key] = 0
        return held
