"""How a simulated drive notices that its master is gone: by heartbeat or node guarding (CiA 301). Pure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from common.clock import NS_PER_MS
from slave.servos.canopen import pdo


@dataclass(slots=True)
class MasterWatch:
    """What one drive was told to watch for."""

    beat_id: int = pdo.HEARTBEAT
    dead_ns: int = 0
    """0: heartbeats are not watched for."""
    guard_ns: int = 0
    life_factor: int = 0
    toggle: int = 0
    _heard_ns: int | None = None
    _asked_ns: int | None = None

    def consumer(self, entry: int) -> None:
        """1016h:1 is written."""
        self.beat_id = pdo.HEARTBEAT + (entry >> 16 & 0x7F)
        self.dead_ns = (entry & 0xFFFF) * NS_PER_MS

    def heard(self, now_ns: int) -> None:
        """The master's heartbeat has come."""
        self._heard_ns = now_ns

    def asked(self, now_ns: int) -> int:
        """The master asks for the state; the toggle bit of the answer."""
        self._asked_ns = now_ns
        self.toggle ^= 0x80
        return self.toggle ^ 0x80

    def gone(self, now_ns: int) -> bool:
        """Whether the master is gone; told once."""
        life_ns = self.guard_ns * self.life_factor
        silent = self._heard_ns is not None and 0 < self.dead_ns < now_ns - self._heard_ns
        unasked = self._asked_ns is not None and 0 < life_ns < now_ns - self._asked_ns
        if silent:
            self._heard_ns = None
        if unasked:
            self._asked_ns = None
        return silent or unasked


@dataclass(slots=True)
class RpdoTimers:
    """The event timers of a drive's RPDOs (1400h:5, …): it misses those that do not come in time."""

    ms: dict[int, int]
    """By the index of their communication parameters; 0: not watched for."""
    _heard_ns: int | None = None

    def heard(self, now_ns: int) -> None:
        """An RPDO has come."""
        self._heard_ns = now_ns

    def expired(self, now_ns: int, on: Callable[[int], bool]) -> bool:
        """Whether one that is on, and has come before, is overdue; told once."""
        if self._heard_ns is None:
            return False
        late_ns = now_ns - self._heard_ns
        late = any(ms and late_ns > ms * NS_PER_MS and on(index) for index, ms in self.ms.items())
        if late:
            self._heard_ns = None
        return late
