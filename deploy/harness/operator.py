"""The demo's operator: sees that the robot holds, engages it anew by an act of his own, and gives up in time.

The rule: the demo fails when a robot has held HOLDS times within HOLDS_WITHIN_S, or is not back in `track`
BACK_S after it left. A hold that the host itself explains (excuse.py) is printed like any other,
with the evidence, but does not count to the first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from common.clock import to_ns, to_s
from common.wire.messages import RobotState
from deploy.harness.excuse import Lost

HOLDS, HOLDS_WITHIN_S = 3, 20.0
BACK_S = 20.0
JUDGED_AFTER_S = 1.0

HostLost = Callable[[int], Lost]
"""What the host lost just before a time of its clock, ns."""


@dataclass(slots=True)
class Hold:
    """The robot had moved, and held without being asked to."""

    robot: str
    began_ns: int
    """Robot's clock; in a demo the host's."""
    was: str
    """`align` or `track`."""
    reason: str
    tracked_ns: int | None = None
    """When it tracked again; None where it has not yet."""


@dataclass(slots=True)
class Operator:
    """One robot's operator. Pure: states in, whether to engage and whether to give up out."""

    robot: str
    host_lost: HostLost
    holds: list[Hold] = field(default_factory=list)
    guard: str = "silent"
    reason: str = "not heard"
    engaged_ns: int = 0
    """When it was first seen to move; 0 before."""
    refused: str = ""
    """What the robot last answered when it did not engage."""
    _left_ns: int = 0

    def begin(self, now_ns: int) -> None:
        """From now on the robot is wanted in `track`."""
        self._left_ns = now_ns

    def see(self, states: Iterable[RobotState]) -> list[str]:
        """Take the states heard since the last time, and return what there is to say."""
        said: list[str] = []
        for state in states:
            said += self._see(state)
        return said

    def _see(self, state: RobotState) -> list[str]:
        before, self.guard, self.reason = self.guard, state.guard, state.reason
        if state.guard in ("align", "track") and not self.engaged_ns:
            self.engaged_ns = state.sent_ns
        if state.guard == "hold" and before in ("align", "track"):
            if before == "track":
                self._left_ns = state.sent_ns
            self.holds.append(Hold(self.robot, state.sent_ns, before, state.reason))
            at_s = to_s(state.sent_ns - self.engaged_ns)
            return [f"{self.robot} holds after {at_s:.1f} s: {state.reason}; the operator engages again"]
        if state.guard == "track" and before != "track":
            return self._back(state.sent_ns)
        return []

    def _back(self, now_ns: int) -> list[str]:
        open_ = [hold for hold in self.holds if hold.tracked_ns is None]
        for hold in open_:
            hold.tracked_ns = now_ns
        return [f"{self.robot} tracks again: {self._in_words(hold)}" for hold in open_]

    def _in_words(self, hold: Hold) -> str:
        row = self.row(hold)
        blame = "counts" if row["counts"] else "does not count"
        return f"out of track for {row['lasted_s']:.1f} s; {blame}: just before, {row['host']}"

    @property
    def tracks(self) -> bool:
        """Whether the robot follows."""
        return self.guard == "track"

    @property
    def wants_to_engage(self) -> bool:
        """Whether it stands and has to be told to move."""
        return self.guard == "hold"

    def gives_up(self, now_ns: int) -> str | None:
        """Why the demo fails, in words; None while it goes on."""
        if self.guard == "estop":
            return f"{self.robot} is in estop: {self.reason}"
        # a core that still stands can tell of it only later
        old = [hold for hold in self.holds if now_ns - hold.began_ns > to_ns(JUDGED_AFTER_S)]
        counted = [hold for hold in old if self._counts(hold)][-HOLDS:]
        if len(counted) == HOLDS and counted[-1].began_ns - counted[0].began_ns <= to_ns(HOLDS_WITHIN_S):
            return f"{self.robot} held {HOLDS} times within {HOLDS_WITHIN_S:g} s, last: {counted[-1].reason}"
        if not self.tracks and now_ns - self._left_ns > to_ns(BACK_S):
            refused = f"; asked to engage: {self.refused}" if self.refused else ""
            return f"{self.robot} did not track for {BACK_S:g} s: {self.guard} ({self.reason}){refused}"
        return None

    def _counts(self, hold: Hold) -> bool:
        return not self.host_lost(hold.began_ns).explains_hold

    def row(self, hold: Hold) -> dict[str, Any]:
        """One of a report's `holds`."""
        lost = self.host_lost(hold.began_ns)
        lasted_ns = None if hold.tracked_ns is None else hold.tracked_ns - hold.began_ns
        return {
            "robot": hold.robot,
            "at_s": round(to_s(hold.began_ns - self.engaged_ns), 2),
            "was": hold.was,
            "reason": hold.reason,
            "lasted_s": None if lasted_ns is None else round(to_s(lasted_ns), 2),
            "host_still_ms": round(1e3 * lost.excused_s),
            "host": str(lost),
            "counts": self._counts(hold),
        }
