"""Which robots and operators are there, from their tokens and the robots' summaries. Pure: time is given.

A token says that a process lives; a summary says what the robot does. Only both together, and a summary that
came lately by this host's own clock, describe a robot. Neither moves anything: what a robot does it decides
when it is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from common.clock import to_ns, to_s
from common.errors import CodecError
from common.wire.presence import OperatorPresence, ProcessPresence
from common.wire.summary import RobotSummary, decode_summary
from common.wire.topics import SUMMARY

MOST_ROBOTS = 20_000
"""More are counted, and not listed: tokens of a faulty host must not take all memory."""


@dataclass(slots=True)
class ListedRobot:
    """What is known of the robots of one name."""

    robot: str
    processes: dict[int, ProcessPresence] = field(default_factory=dict)
    """Those that live now, by instance; more than one: two robots bear one name."""
    summary: RobotSummary | None = None
    heard_ns: int = 0
    """When the summary came."""
    appeared_ns: int = 0

    def fresh(self, now_ns: int) -> RobotSummary | None:
        """The summary, if it came lately from the one process that lives under this name; else None."""
        summary = self.summary
        if summary is None or len(self.processes) != 1 or summary.instance not in self.processes:
            return None
        return summary if 0 <= now_ns - self.heard_ns <= to_ns(SUMMARY.timeout_s) else None

    def waits_s(self, now_ns: int) -> float | None:
        """For how long somebody at the robot has waited for an operator; None: nobody waits."""
        summary = self.fresh(now_ns)
        if summary is None or summary.call is None:
            return None
        return summary.call.since_s + to_s(now_ns - self.heard_ns)


class Roster:
    """The list. `pattern`: of the robots' names that it takes, such as `ward-*`."""

    def __init__(self, *patterns: str) -> None:
        self._patterns = patterns or ("*",)
        self._robots: dict[str, ListedRobot] = {}
        self.asking: set[str] = set()
        """Robots whose newest summary names an operator who has asked for it, or to whom it is offered."""
        self.operators: dict[str, set[int]] = {}
        """The masters that live, by operator."""
        self.received = self.undecodable = 0
        self.late = 0
        """Summaries that were older than one that had come before."""
        self.beyond = 0
        """Robots that were not listed as there are too many."""

    def on_presence(self, presence: ProcessPresence, here: bool, now_ns: int) -> None:
        """A process showed itself, or went."""
        if presence.role != "slave" or not presence.instance or not self._takes(presence.robot):
            return
        if not here:
            listed = self._robots.get(presence.robot)
            if listed is not None:
                listed.processes.pop(presence.instance, None)
                if not listed.processes:
                    del self._robots[presence.robot]
                    self.asking.discard(presence.robot)
            return
        listed = self._listed(presence.robot, now_ns)
        if listed is not None:
            listed.processes[presence.instance] = presence

    def on_operator(self, presence: OperatorPresence, here: bool) -> None:
        """A master showed itself, or went."""
        masters = self.operators.setdefault(presence.operator, set())
        if here:
            masters.add(presence.instance)
        else:
            masters.discard(presence.instance)
        if not masters:
            del self.operators[presence.operator]

    def on_summary(self, key: str, payload: bytes, arrived_ns: int) -> None:
        """A summary came. It changes nothing where no process of that name and instance is known to live."""
        try:
            summary = decode_summary(payload)
        except CodecError:
            self.undecodable += 1
            return
        listed = self._robots.get(summary.robot)
        # access rules go by the key, so the name within must be the one they were asked about
        if (
            listed is None
            or key != SUMMARY.key_for(summary.robot)
            or summary.instance not in listed.processes
        ):
            return
        before = listed.summary
        if before is not None and before.instance == summary.instance and summary.sequence <= before.sequence:
            self.late += 1
            return
        self.received += 1
        (self.asking.add if summary.wanted_by or summary.offered_to else self.asking.discard)(summary.robot)
        listed.summary, listed.heard_ns = summary, arrived_ns

    def __contains__(self, robot: object) -> bool:
        return robot in self._robots

    def __len__(self) -> int:
        return len(self._robots)

    def get(self, robot: str) -> ListedRobot | None:
        """The robot of that name, if one is there."""
        return self._robots.get(robot)

    def robots(self) -> list[ListedRobot]:
        """All, by name."""
        return [self._robots[name] for name in sorted(self._robots)]

    def _takes(self, robot: str) -> bool:
        return any(fnmatchcase(robot, pattern) for pattern in self._patterns)

    def _listed(self, robot: str, now_ns: int) -> ListedRobot | None:
        listed = self._robots.get(robot)
        if listed is None:
            if len(self._robots) >= MOST_ROBOTS:
                self.beyond += 1
                return None
            listed = self._robots[robot] = ListedRobot(robot, appeared_ns=now_ns)
        return listed
