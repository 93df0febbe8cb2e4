"""When a stall of the host excuses a failure: the one rule, pure.

A core that comes back late was taken by the host, or kept busy by tandem itself. Only the host's part excuses
a failure, so it needs evidence. If the reference loop had real-time priority, above all programs of tandem,
the whole stall is the host's. If `/proc/stat` shows steal, the stolen part is. Otherwise nothing is excused.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from common.clock import to_ns, to_s

STILL_S = 0.05
"""A host stall of this length within WINDOW_S can make a guard hold. It is half of the guard's shortest
time-out (the encoders', 0.1 s). Several stalls are added: after each, every process catches up at once."""
WINDOW_S = 0.5


class StallEvidence(StrEnum):
    """What shows that the host caused a stall; the text is printed."""

    PRIORITY = "the reference loop had real-time priority"
    STEAL = "/proc/stat shows steal"
    NONE = "neither real-time priority nor steal"


@dataclass(frozen=True, slots=True)
class LoopsBegan:
    """The first line of the reference loops."""

    cores: list[int]
    """Cores on which a loop runs."""
    origin_ns: int
    """Time of their first tick, by this host's monotonic clock."""
    priority: bool
    """Whether the loops have real-time priority."""


@dataclass(frozen=True, slots=True)
class Stall:
    """A core came back at `until_ns` and was due at `from_ns`, by this host's monotonic clock."""

    core: int
    from_ns: int
    until_ns: int
    missed: int
    """Ticks of the reference loop."""
    stolen_ns: int = 0
    """Steal of this core since the loop last read it, at most 0.25 s before the stall; to 10 ms."""
    priority: bool = False
    """Whether the loop had real-time priority."""

    @property
    def evidence(self) -> StallEvidence:
        """What shows that the host caused it."""
        if self.priority:
            return StallEvidence.PRIORITY
        return StallEvidence.STEAL if self.stolen_ns > 0 else StallEvidence.NONE

    @property
    def excused_ns(self) -> int:
        """How much of it excuses: all of it, the stolen part, or nothing; taken from its end."""
        lasted_ns = self.until_ns - self.from_ns
        return lasted_ns if self.evidence is StallEvidence.PRIORITY else min(lasted_ns, self.stolen_ns)


@dataclass(frozen=True, slots=True)
class Lost:
    """What a host lost between two times."""

    excused_s: float
    """The part of the stalls that the host caused: a result may be late by this much."""
    still_s: float
    """All stalls, whatever caused them."""
    evidence: StallEvidence

    @property
    def explains_hold(self) -> bool:
        """Whether a guard may have held for it."""
        return self.excused_s >= STILL_S

    def __str__(self) -> str:
        """For a person, with the evidence."""
        if self.excused_s > 0.0:
            return f"the host stalled for {1e3 * self.excused_s:.0f} ms: {self.evidence}"
        if self.still_s > 0.0:
            return f"a core came back {1e3 * self.still_s:.0f} ms late, not excused: {self.evidence}"
        return "the host kept its time"


def lost(stalls: Iterable[Stall], since_ns: int, until_ns: int) -> Lost:
    """What was lost between the two times, each moment counted once."""
    near = [stall for stall in stalls if stall.from_ns < until_ns and stall.until_ns > since_ns]
    excused = [(stall.until_ns - stall.excused_ns, stall.until_ns) for stall in near]
    shown = {stall.evidence for stall, span in zip(near, excused, strict=True) if span[1] > span[0]}
    return Lost(
        _union_s(excused, since_ns, until_ns),
        _union_s(((stall.from_ns, stall.until_ns) for stall in near), since_ns, until_ns),
        next((each for each in StallEvidence if each in shown), StallEvidence.NONE),
    )


def lost_before(stalls: Iterable[Stall], at_ns: int, since_ns: int = 0) -> Lost:
    """What was lost in the WINDOW_S before something happened, but not before `since_ns`."""
    return lost(stalls, max(since_ns, at_ns - to_ns(WINDOW_S)), at_ns)


def _union_s(spans: Iterable[tuple[int, int]], since_ns: int, until_ns: int) -> float:
    total_ns, reached_ns = 0, since_ns
    for from_ns, to_ns_ in sorted(spans):
        end_ns = min(to_ns_, until_ns)
        total_ns += max(0, end_ns - max(from_ns, reached_ns))
        reached_ns = max(reached_ns, end_ns)
    return to_s(total_ns)
