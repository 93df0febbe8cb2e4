"""Which of the robots that are merely watched this master claims, and when it lets one go. Pure.

A watched robot costs its presence and one summary a second. It is claimed when its own summary, lately come
from the only process of its name, says that this operator has asked for it (`tandem take`) or that its holder
offers it to this operator. Presence alone never leads to a claim, and a claim moves nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from common.clock import to_ns
from common.link.roster import ListedRobot, Roster
from common.wire.summary import RobotSummary

GONE_S = 60.0
"""A taken robot that has been gone for so long is let go: its lease has lapsed long ago."""


@dataclass(frozen=True, slots=True)
class TakenRobot:
    """A robot that this master commands although its file does not name it."""

    held: bool
    """Whether it holds the lease."""
    lost_ns: int
    """When it lost the lease last; 0: it never had it."""


class WatchedRobots:
    """Decides from the roster."""

    def __init__(self, operator: str, patterns: Sequence[str], profile: str) -> None:
        self._operator = operator
        self._profile = profile
        self.roster = Roster(*patterns)
        self._gone_ns: dict[str, int] = {}
        self._refused: dict[str, str] = {}
        """Why a robot that was asked for is not claimed."""
        self.said: list[str] = []
        """Messages for the log, since the last `to_take`."""

    def to_take(self, now_ns: int, taken: Collection[str]) -> list[str]:
        """The robots to command from now on."""
        self.said = []
        # few ask, of the many that are there
        asking = (self.roster.get(robot) for robot in sorted(self.roster.asking) if robot not in taken)
        return [
            one.robot for one in asking if one is not None and self._wants(one, now_ns) and self._fits(one)
        ]

    def to_let_go(self, now_ns: int, taken: Mapping[str, TakenRobot]) -> dict[str, str]:
        """The robots to command no more, each with the reason."""
        out = {}
        for robot, one in taken.items():
            why = None if one.held else self._over(robot, one, now_ns)
            if why is not None:
                out[robot] = why
                self._gone_ns.pop(robot, None)
        return out

    def may_claim(self, robot: str, now_ns: int, lost_ns: int) -> bool:
        """Whether a taken robot may be claimed: a summary that came after the lease was lost says it is free.

        Else a robot that its operator has just let go would be claimed again.
        """
        listed = self.roster.get(robot)
        summary = None if listed is None else listed.fresh(now_ns)
        if listed is None or summary is None or listed.heard_ns <= lost_ns:
            return False
        if self._asked(summary):
            return True
        return not summary.operator and summary.let_go_by != self._operator

    def _wants(self, listed: ListedRobot, now_ns: int) -> bool:
        summary = listed.fresh(now_ns)
        return summary is not None and self._asked(summary)

    def _asked(self, summary: RobotSummary) -> bool:
        return self._operator in (summary.wanted_by, summary.offered_to)

    def _fits(self, listed: ListedRobot) -> bool:
        (process,) = listed.processes.values()
        why = process.other_version
        if not why and process.profile not in ("", self._profile):
            why = f"its profile is {process.profile}, this master's is {self._profile}"
        if why and self._refused.get(listed.robot) != why:
            self.said.append(f"{listed.robot} is not claimed: {why}")
        if why:
            self._refused[listed.robot] = why
        return not why

    def _over(self, robot: str, one: TakenRobot, now_ns: int) -> str | None:
        listed = self.roster.get(robot)
        if listed is None:
            since_ns = self._gone_ns.setdefault(robot, now_ns)
            gone = abs(now_ns - since_ns) > to_ns(GONE_S)
            return f"it has been gone for more than {GONE_S:g} s" if gone else None
        self._gone_ns.pop(robot, None)
        summary = listed.fresh(now_ns)
        if summary is None or listed.heard_ns <= one.lost_ns or self._asked(summary):
            return None
        if summary.operator and summary.operator != self._operator:
            return f"{summary.operator} commands it now"
        if summary.let_go_by == self._operator:
            return f"{self._operator} let it go"
        return None if one.lost_ns else "it is not wanted any more"
