"""By how much time one step of the guard may move the setpoint on: never more than the longest step."""

from __future__ import annotations

from common.clock import to_s
from slave.guard.events import GuardCounters


class StepTime:
    """The time between two steps, bounded; a step that came late is counted."""

    def __init__(self, max_step_s: float, counters: GuardCounters) -> None:
        self._max_step_s = max_step_s
        self._counters = counters
        self._stepped_ns: int | None = None

    def elapsed_s(self, now_ns: int) -> float:
        """Since the last step, 0 at the first."""
        before_ns, self._stepped_ns = self._stepped_ns, now_ns
        if before_ns is None:
            return 0.0
        dt_s = to_s(now_ns - before_ns)
        if not 0.0 <= dt_s <= self._max_step_s:
            self._counters.late_steps += 1
        return min(max(dt_s, 0.0), self._max_step_s)
