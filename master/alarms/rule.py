"""Which tone is due when. Pure: the time and what is the matter in, an alarm or none out."""

from __future__ import annotations

from collections.abc import Set

from common.clock import to_ns
from master.alarms.alarm import MELODIES, QUIET_NS, REPEATS_NS, Alarm
from master.alarms.tones import burst_s

_NEVER = -(1 << 62)


class AlarmRule:
    """One operator's alarms.

    A higher priority cuts off a lower one; of the same or a lower priority a burst waits until the other has
    ended. An alarm repeats while its cause lasts, or not at all, and never more often than its quiet time.
    """

    def __init__(self) -> None:
        self._active: frozenset[Alarm] = frozenset()
        self._told: set[Alarm] = set()
        """Those active that have sounded since they began."""
        self._ended_ns: dict[Alarm, int] = {}
        """When each one's newest burst ends."""
        self._sounding: Alarm | None = None
        self._paused_until_ns = _NEVER
        self._paused: frozenset[Alarm] = frozenset()

    def pause(self, now_ns: int, for_s: float) -> None:
        """Silence what is active now for so long. What begins meanwhile is heard all the same."""
        self._paused, self._paused_until_ns = self._active, now_ns + to_ns(for_s)

    def step(self, now_ns: int, active: Set[Alarm]) -> Alarm | None:
        """The alarm whose burst begins now; None: whatever sounds goes on, or nothing does."""
        self._active = frozenset(active)
        self._told &= active
        self._paused = self._paused & active if now_ns < self._paused_until_ns else frozenset()
        sounding = self._sounding
        if sounding is not None and now_ns >= self._ended_ns[sounding]:
            sounding = self._sounding = None
        due = [alarm for alarm in Alarm if alarm in active - self._paused and self._due(now_ns, alarm)]
        if not due:
            return None
        first = max(due, key=lambda alarm: MELODIES[alarm].priority)
        if sounding is not None and MELODIES[first].priority <= MELODIES[sounding].priority:
            return None
        self._sounding = first
        self._told.add(first)
        self._ended_ns[first] = now_ns + to_ns(burst_s(first))
        return first

    def _due(self, now_ns: int, alarm: Alarm) -> bool:
        since_ns = now_ns - self._ended_ns.get(alarm, _NEVER)
        priority = MELODIES[alarm].priority
        if since_ns < QUIET_NS[priority]:
            return False
        repeats_ns = REPEATS_NS[priority]
        return alarm not in self._told or (repeats_ns is not None and since_ns >= repeats_ns)
