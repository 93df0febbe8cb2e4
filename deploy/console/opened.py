"""Robots that a page opens although the console's file does not name them, and the list that it picks from.

A robot that is open is heard in full, 50 states a second and its pictures; all others send a summary a
second. One that no page shows any more is closed, unless a stop of it is still under way.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection

from common.clock import to_ns
from common.link import LinkSession
from common.link.roster import Roster
from deploy.client.roster_view import RosterRows, roster_rows
from deploy.console.hearing import Hearing
from deploy.console.model.guard_table import ENGAGED
from deploy.console.model.robot import RobotModel
from deploy.console.stopping import RobotStopper

MOST_OPEN = 8
"""Robots that pages may open at once, beside those that the file names."""
KEPT_S = 10.0
"""A page that loads again finds its robot still open."""

log = logging.getLogger(__name__)


class OpenedRobots:
    """Opens and closes robots of the roster."""

    def __init__(
        self,
        roster: Roster,
        hearing: Hearing,
        stoppers: dict[str, RobotStopper],
        *,
        session: LinkSession,
        profile: str,
        operator: str,
        make: Callable[[str], tuple[RobotModel, RobotStopper]],
    ) -> None:
        """`make`: a robot's model and stopper. `profile`: of the robots that this console can draw.

        `operator`: whose console this is.
        """
        self._roster = roster
        self._hearing = hearing
        self._stoppers = stoppers
        self._session = session
        self._profile = profile
        self._operator = operator
        self._make = make
        self.on_close: Callable[[str], None] = lambda robot: None
        """Called before a robot's link is withdrawn."""
        self._unseen_ns: dict[str, int | None] = {}
        """The robots that were opened: since when no page shows each."""

    def rows(self, now_ns: int) -> RosterRows:
        """The list."""
        return roster_rows(self._roster, now_ns)

    def engaged(self, now_ns: int) -> list[str]:
        """Robots of the list that follow this console's operator, whether a page shows them or not."""
        fresh = [(listed.robot, listed.fresh(now_ns)) for listed in self._roster.robots()]
        return [
            robot
            for robot, summary in fresh
            if summary is not None and summary.operator == self._operator and summary.guard in ENGAGED
        ]

    def lists(self, robot: str) -> bool:
        """Whether a robot of that name is there."""
        return robot in self._roster

    def open(self, robot: str, to_stop: bool = False) -> str:
        """Why a robot cannot be opened; empty: it is open. `to_stop`: however many are open already."""
        if robot in self._hearing.models:
            return ""
        listed = self._roster.get(robot)
        if listed is None:
            return f"no robot {robot} is there"
        if len(self._unseen_ns) >= MOST_OPEN and not to_stop:
            return f"{MOST_OPEN} robots are open already"
        profiles = {each.profile for each in listed.processes.values()} - {"", self._profile}
        if profiles:
            theirs = ", ".join(sorted(profiles))
            return f"{robot} has the profile {theirs}, this console shows {self._profile}"
        model, stopper = self._make(robot)
        self._hearing.open(self._session, model)
        stopper.watch()
        self._stoppers[robot] = stopper
        self._unseen_ns[robot] = None
        log.info("%s: open: its states and pictures come now", robot)
        return ""

    async def close_unseen(self, shown: Collection[str], now_ns: int) -> None:
        """Close what no page has shown for a while. Call it once a second."""
        for robot, since_ns in list(self._unseen_ns.items()):
            if robot in shown or self._stoppers[robot].under_way:
                self._unseen_ns[robot] = None
            elif since_ns is None:
                self._unseen_ns[robot] = now_ns
            elif now_ns - since_ns > to_ns(KEPT_S):
                del self._unseen_ns[robot]
                await self._stoppers.pop(robot).close()
                self._hearing.close(robot)
                self.on_close(robot)
                self._session.drop(robot)
                log.info("%s: closed", robot)
