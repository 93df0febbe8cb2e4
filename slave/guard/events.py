"""What the guard did, to be read later: counters, and a bounded ring of the newest events."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from common.metrics.slave import GuardMetrics


class Rule(StrEnum):
    """Which limit a clamp kept."""

    POSITION = "position"
    """rad: where the joint was asked to be or would have come to rest, and the limit."""
    VELOCITY = "velocity"
    """rad/s"""
    ACCELERATION = "acceleration"
    """rad/s²"""
    DISTANCE = "distance"
    """rad/s: two parts of the robot, or one and a zone, are near each other."""


@dataclass(frozen=True, slots=True)
class Clamp:
    """A joint began to be given less than was asked; asked and given are in the rule's unit."""

    at_ns: int
    joint: str
    rule: Rule
    asked: float
    given: float


@dataclass(frozen=True, slots=True)
class Change:
    """The guard went from one state to another."""

    at_ns: int
    before: str
    after: str
    reason: str


@dataclass(frozen=True, slots=True)
class Doubt:
    """A joint began to be held because its encoder is not believed."""

    at_ns: int
    joint: str
    words: str


class Journal:
    """The newest events; older ones fall out, and only the counters remember them."""

    def __init__(self, size: int) -> None:
        self._events: deque[Clamp | Change | Doubt] = deque(maxlen=size)

    def add(self, event: Clamp | Change | Doubt) -> None:
        """Append one."""
        self._events.append(event)

    def __iter__(self) -> Iterator[Clamp | Change | Doubt]:
        """Oldest first."""
        return iter(tuple(self._events))

    def __len__(self) -> int:
        return len(self._events)


@dataclass(slots=True)
class GuardCounters:
    """Totals since start."""

    received: int = 0
    accepted: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    """Refused commands by gate."""
    losses: Counter[str] = field(default_factory=Counter)
    """Holds by what was lost."""
    clamps: Counter[str] = field(default_factory=Counter)
    """Clamps begun, by rule."""
    doubts: Counter[str] = field(default_factory=Counter)
    """Times that a joint was held because its encoder was not believed, by joint."""
    foreign_requests: int = 0
    """Requests in another operator's name than that of the key on which they came: refused."""
    late_steps: int = 0
    """Steps so late that the setpoint was moved by less than the time that had passed."""

    def metrics(self, state: str, reason: str) -> GuardMetrics:
        """The counters so far, with the guard's state and why it is there."""
        return GuardMetrics(
            state=state,
            reason=reason,
            received=self.received,
            accepted=self.accepted,
            dropped=dict(self.dropped),
            losses=dict(self.losses),
            clamps={str(rule): count for rule, count in self.clamps.items()},
            doubts=dict(self.doubts),
            foreign_requests=self.foreign_requests,
            late_steps=self.late_steps,
        )
