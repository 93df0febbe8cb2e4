"""The operator of a robot: engages it, engages it again after a hold, and gives up in time. Pure.

States and time come in, decisions come out; `deploy/harness/engage.py` carries them out. All experiments use
this rule. Each has its own `OperatorPatience`, and decides itself when its robot is ready.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from common.clock import to_s
from deploy.harness.excuse import Lost, StallEvidence

JUDGED_AFTER_S = 1.0
"""A hold is judged this much later: a core reports its stall only when it runs again."""

HostLost = Callable[[int], Lost]
"""What the host lost just before a time of its clock, ns."""


@dataclass(frozen=True, slots=True)
class GuardSight:
    """What an operator sees of a robot at one moment."""

    at_ns: int
    guard: str
    reason: str


@dataclass(frozen=True, slots=True)
class OperatorPatience:
    """When an operator gives up on a robot. A robot in `estop` is given up at once."""

    back_s: float = 20.0
    """The robot must track again within this, from when it left `track`."""
    holds: int | None = None
    """So many holds within `holds_within_s` are too many; a hold that the host explains does not count.
    None: any number is fine."""
    holds_within_s: float = 20.0


@dataclass(slots=True)
class UnaskedHold:
    """The robot moved, and held without being asked to."""

    robot: str
    began_ns: int
    was: str
    """The guard's state before: `align` or `track`."""
    reason: str
    engaged_ns: int | None = None
    """When the operator engaged again; None while he has not."""
    refused: str = ""
    """What the robot last answered when it refused to engage."""
    tracked_ns: int | None = None
    """When it tracked again; None while it does not."""


@dataclass(frozen=True, slots=True)
class HoldRecord:
    """One of a report's `holds`."""

    robot: str
    at_s: float
    """Since the robot first moved."""
    was: str
    reason: str
    lasted_s: float | None
    """Until it tracked again; None where it did not."""
    host_still_ms: int
    """The excused part of the host's stalls just before."""
    host: str
    """The same for a person, with the evidence."""
    counts: bool
    """Whether it counts against the robot."""


@dataclass(slots=True)
class Operator:
    """One robot's operator."""

    robot: str
    patience: OperatorPatience | None = None
    """None: he never gives up."""
    wanted_ns: int = 0
    """Since when the robot is to track."""
    again_s: float = 0.0
    """How long he waits after one request to engage before the next."""
    host_lost: HostLost = lambda _: Lost(0.0, 0.0, StallEvidence.NONE)
    guard: str = "silent"
    reason: str = "not heard"
    holds: list[UnaskedHold] = field(default_factory=list)
    moved_ns: int = 0
    """When the robot was first seen to move; 0 before."""
    engaged: int = 0
    """How often a request to engage was granted."""
    engaged_ns: int = 0
    """When it was last granted; 0 before."""
    refused: str = ""
    """What the robot last answered; empty when it engaged."""
    _asked_ns: int | None = None

    def see(self, sight: GuardSight) -> list[UnaskedHold]:
        """Take what was seen next, and return the holds that it began or ended."""
        before, self.guard, self.reason = self.guard, sight.guard, sight.reason
        if self.guard in ("align", "track") and not self.moved_ns:
            self.moved_ns = sight.at_ns
        if self.guard == "hold" and before in ("align", "track"):
            if before == "track":
                self.wanted_ns = sight.at_ns
            self.holds.append(UnaskedHold(self.robot, sight.at_ns, before, sight.reason))
            return self.holds[-1:]
        if self.guard == "track" and before != "track":
            ended = [hold for hold in self.holds if hold.tracked_ns is None]
            for hold in ended:
                hold.tracked_ns = sight.at_ns
            return ended
        return []

    @property
    def tracks(self) -> bool:
        """Whether the robot follows."""
        return self.guard == "track"

    def engages(self, now_ns: int, ready: bool = True) -> bool:
        """Whether he engages the robot now: it holds, it is ready, and he has not just asked."""
        waited = self._asked_ns is None or to_s(now_ns - self._asked_ns) >= self.again_s
        return self.guard == "hold" and ready and waited

    def answered(self, now_ns: int, refusal: str) -> None:
        """Take the robot's answer to a request to engage; an empty refusal means that it engaged."""
        self._asked_ns, self.refused = now_ns, refusal
        if not refusal:
            self.engaged += 1
            self.engaged_ns = now_ns
        if self.holds and self.holds[-1].tracked_ns is None:
            self.holds[-1].refused = refusal or self.holds[-1].refused
            if not refusal:
                self.holds[-1].engaged_ns = now_ns

    def gives_up(self, now_ns: int) -> str | None:
        """Why he gives up on the robot; None while he does not."""
        patience = self.patience
        if patience is None:
            return None
        if self.guard == "estop":
            return f"{self.robot} is in estop: {self.reason}"
        if (last := self._one_too_many(patience, now_ns)) is not None:
            within_s = f"{patience.holds_within_s:g}"
            return f"{self.robot} held {patience.holds} times within {within_s} s, last: {last.reason}"
        if not self.tracks and to_s(now_ns - self.wanted_ns) > patience.back_s:
            refused = f"; asked to engage: {self.refused}" if self.refused else ""
            return (
                f"{self.robot} did not track for {patience.back_s:g} s: {self.guard} ({self.reason}){refused}"
            )
        return None

    def _one_too_many(self, patience: OperatorPatience, now_ns: int) -> UnaskedHold | None:
        if patience.holds is None:
            return None
        old = [hold for hold in self.holds if to_s(now_ns - hold.began_ns) > JUDGED_AFTER_S]
        counted = [hold for hold in old if self._counts(hold)][-patience.holds :]
        if len(counted) < patience.holds:
            return None
        lasted_s = to_s(counted[-1].began_ns - counted[0].began_ns)
        return counted[-1] if lasted_s <= patience.holds_within_s else None

    def _counts(self, hold: UnaskedHold) -> bool:
        return not self.host_lost(hold.began_ns).explains_hold

    def words(self, hold: UnaskedHold) -> str:
        """The line that a person reads when the hold begins, and when it is over."""
        record = self.record(hold)
        if record.lasted_s is None:
            return f"{self.robot} holds after {record.at_s:.1f} s: {hold.reason}; the operator engages again"
        counts = "counts" if record.counts else "does not count"
        lasted = f"out of track for {record.lasted_s:.1f} s"
        return f"{self.robot} tracks again: {lasted}; {counts}: just before, {record.host}"

    def record(self, hold: UnaskedHold) -> HoldRecord:
        """A hold as a report has it."""
        lost = self.host_lost(hold.began_ns)
        lasted_s = None if hold.tracked_ns is None else to_s(hold.tracked_ns - hold.began_ns)
        return HoldRecord(
            robot=hold.robot,
            at_s=round(to_s(hold.began_ns - self.moved_ns), 2),
            was=hold.was,
            reason=hold.reason,
            lasted_s=None if lasted_s is None else round(lasted_s, 2),
            host_still_ms=round(1e3 * lost.excused_s),
            host=str(lost),
            counts=self._counts(hold),
        )
