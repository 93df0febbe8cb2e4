"""Differences of counters that only grow, and start again at 0 with each process. Pure."""

from __future__ import annotations

from common.metrics.parts import Summary


class Additions:
    """Remembers each counter's last value. A value that fell is of a new process: all of it was added."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def take(self, name: str, value: float) -> float:
        """What the counter has gained since the last time."""
        before, self._last[name] = self._last.get(name, 0.0), value
        return value if value < before else value - before

    def mean(self, name: str, summary: Summary) -> tuple[float, float]:
        """How many were recorded since the last time, and their mean."""
        count, total = summary.count, summary.total
        fell = count < self._last.get(f"{name}.count", 0.0)
        added = self.take(f"{name}.count", count)
        before = 0.0 if fell else self._last.get(f"{name}.sum", 0.0)
        self._last[f"{name}.sum"] = total
        return added, (total - before) / added if added else float("nan")
