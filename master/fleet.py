"""The robots of one operator: those that the file names, and those that the operator takes and lets go."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from functools import partial

from common.clock import monotonic_ns, to_ns
from common.clock_sync.services import keep_reference
from common.link import LinkSession
from common.link.place import own_endpoints
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.skeleton import Skeleton
from common.wire.messages import ClockReference
from common.wire.together import beside
from master.comfort.scaling import MotionScaling
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.joint_angles.sample import JointAngleSample
from master.robot import CommandedRobot
from master.watched import WatchedRobots

WATCH_PERIOD_NS = to_ns(0.1)

log = logging.getLogger(__name__)


class Fleet:
    """Commands every robot of the operator; robots of a pattern come and go while it runs."""

    def __init__(self, config: MasterConfig, session: LinkSession, skeleton: Skeleton) -> None:
        self._config = config
        self._session = session
        self._skeleton = skeleton
        self._endpoints = own_endpoints(config.link)
        self.robots = [self._robot(name) for name in config.commanded]
        self.watched = WatchedRobots(config.operator.name, config.watched, config.profile)
        self.tasks: list[asyncio.Task[None]] = []
        """Of the robots that the file names, and of the watch."""
        self._serving: dict[str, asyncio.Task[None]] = {}
        """Of the robots that were taken: the file names a pattern of them at most."""
        self._given_up: set[str] = set()

    def __iter__(self) -> Iterator[CommandedRobot]:
        return iter(self.robots)

    def start(self, tasks: asyncio.TaskGroup) -> None:
        """Keep the lease and clock of each robot, and heed what the operator takes."""
        self.tasks = [tasks.create_task(self._serve(robot)) for robot in self.robots]
        if self._config.watched:
            self.tasks.append(tasks.create_task(self._watch(tasks)))
        telling = keep_reference(self._config.clock, self._tell_reference)
        self.tasks.append(tasks.create_task(telling))

    def _tell_reference(self, reference: ClockReference | None, steps: int) -> None:
        for robot in self.robots:
            robot.clock.tell(reference, steps)

    def send(self, angles: JointAngleSample, grip: Grip, angles_ns: int) -> Iterator[CommandedRobot]:
        """Put the posture on each robot's topic; yields each robot after that."""
        others = beside([robot.name for robot in self._commanded if robot.moves])
        for robot in self._commanded:
            robot.send(angles, grip, angles_ns, "" if robot.moves else others)
            yield robot

    @property
    def wanted_ms(self) -> dict[str, int]:
        """By robot that obeys this operator, the period between two commands that it asks for; 0: none."""
        wanted = {robot.name: robot.wanted_period_ms for robot in self._commanded}
        return {name: period_ms for name, period_ms in wanted.items() if period_ms is not None}

    @property
    def _commanded(self) -> list[CommandedRobot]:
        return [robot for robot in self.robots if robot.name not in self._given_up]

    def _robot(
        self, name: str, may_claim: Callable[[int, int], bool] = lambda now_ns, lost_ns: True
    ) -> CommandedRobot:
        operator = self._config.operator
        return CommandedRobot(
            name,
            operator.name,
            len(self._skeleton.joints),
            link=self._session.link(name),
            endpoints=self._endpoints,
            scaling=MotionScaling(operator.scaling, self._skeleton),
            may_claim=may_claim,
            tapped=self._session.overheard is not None,
        )

    async def _serve(self, robot: CommandedRobot) -> None:
        """Keep one robot. An unforeseen error stops the commands to this robot only."""
        try:
            await robot.run()
        except Exception:
            self._given_up.add(robot.name)
            if len(self._given_up) == len(self.robots) and not self._config.watched:
                raise
            log.exception(
                "%s: unexpected error: it gets no more commands, so its guard holds; other robots continue",
                robot.name,
            )

    async def _watch(self, tasks: asyncio.TaskGroup) -> None:
        """Command the watched robots that the operator takes, until the operator lets them go."""
        watched = self.watched
        self._session.watch_roster(watched.roster)
        async for due in ticks(TickGrid(monotonic_ns(), WATCH_PERIOD_NS)):
            now_ns = due.scheduled_ns
            taken = {robot.name: robot.taken for robot in self.robots if robot.name in self._serving}
            for name, why in watched.to_let_go(now_ns, taken).items():
                log.info("%s: only watched from now on: %s", name, why)
                self._let_go(name)
            for name in watched.to_take(now_ns, {robot.name for robot in self.robots}):
                log.info("%s: commanded from now on; nothing moves before an engage", name)
                robot = self._robot(name, partial(watched.may_claim, name))
                self.robots.append(robot)
                self._serving[name] = tasks.create_task(self._serve(robot))
            for line in watched.said:
                log.warning("%s", line)

    def _let_go(self, name: str) -> None:
        self._serving.pop(name).cancel()
        self.robots = [robot for robot in self.robots if robot.name != name]
        self._given_up.discard(name)
        self._session.drop(name)
