"""Stops a robot straight over the link, whether or not the master lives: asked again until it says so."""

from __future__ import annotations

import asyncio
import logging

from common.clock import monotonic_ns
from common.link import Link
from common.wire.presence import ProcessPresence
from common.wire.stop import STOPPED, pack_stop
from common.wire.topics import STOP
from deploy.client.answer import RobotAnswer
from deploy.client.stop import OnAnswer, repeat_until_stopped
from deploy.client.stop_count import StopCount
from deploy.console.backup import StopBackup
from deploy.console.model.robot import RobotModel
from deploy.console.model.stopped import StopShown

UNANSWERED_S = 1.0
"""Without an acknowledgement for so long, the page says that nobody knows."""
GIVE_UP_S = 60.0
NOT_STOPPED = "no answer from the robot: use the switch at the robot. This console keeps asking"
GIVEN_UP = "no answer from the robot for 60 s, so it is no longer asked: use the switch at the robot"
ONE_SILENT = "a second robot of this name has not answered: use the switch at each robot"

log = logging.getLogger(__name__)


class RobotStopper:
    """The stops of one robot's name. Who asks needs no role."""

    def __init__(
        self, link: Link, model: RobotModel, operator: str, backup: StopBackup | None = None
    ) -> None:
        """`backup`: goes on asking where this process dies."""
        self._link = link
        self._model = model
        self._operator = operator
        self._backup = backup
        self._here: dict[int, ProcessPresence] = {}
        self._task: asyncio.Task[None] | None = None
        self._count = StopCount(model.robot, GIVE_UP_S)
        self._shown: StopShown | None = None
        """What the questions under way are for."""
        self._number = 0

    def watch(self) -> None:
        """Learn which processes bear the name: each must acknowledge."""
        self._link.watch_presence(self._on_presence)

    @property
    def under_way(self) -> bool:
        """Whether the robot is being asked to stop."""
        return self._task is not None and not self._task.done()

    def stop(self, by: str) -> StopShown:
        """Ask for a stop. A stop under way goes on, and a robot that is stopped already is asked again."""
        self._number += 1
        under_way = self.under_way
        kept = self._backup is None or self._backup.keep(self._model.robot)
        shown = self._model.asked_to_stop(self._number, by, monotonic_ns(), under_way)
        if not under_way or shown is not self._shown:
            if self._task is not None:
                self._task.cancel()
            self._shown = shown
            log.warning("%s: %s asks to stop it", self._model.robot, by)
            self._count = StopCount(self._model.robot, GIVE_UP_S)
            for presence in self._here.values():
                self._count.expect(presence)
            self._task = asyncio.create_task(self._repeat(self._count))
        shown.kept = kept
        return shown

    async def close(self) -> None:
        """End what is under way."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def _on_presence(self, presence: ProcessPresence, here: bool) -> None:
        if presence.role != "slave" or not presence.instance:
            return
        if here:
            self._here[presence.instance] = presence
            if self.under_way:
                # it may have come too late for the question that is on its way
                self._count.expect(presence)
        else:
            self._here.pop(presence.instance, None)

    async def _repeat(self, count: StopCount) -> None:
        known = asyncio.Event()
        known.set()

        async def ask_all(question: bytes, on_answer: OnAnswer) -> object:
            return await self._link.ask_all(STOP, question, on_answer)

        unanswered = asyncio.get_running_loop().call_later(UNANSWERED_S, self._fail, NOT_STOPPED)
        payload = pack_stop(self._model.robot, self._operator)
        try:
            async with asyncio.timeout(GIVE_UP_S):
                await repeat_until_stopped(ask_all, count, payload, known, self._on_answer)
            self._done_with()
        except TimeoutError:
            self._fail(GIVEN_UP)
            self._done_with()
        finally:
            unanswered.cancel()

    def _done_with(self) -> None:
        if self._backup is not None:
            self._backup.done(self._model.robot)

    def _on_answer(self, answer: RobotAnswer) -> None:
        stop = self._model.stop
        if stop is None:
            return
        stop.text = answer.text
        if self._count.complete:
            stop.failed = ""
            if stop.robot_ns is None:
                stop.robot_ns = monotonic_ns()

    def _fail(self, words: str) -> None:
        """Say so, unless each robot of that name has acknowledged or the only one says that it is stopped."""
        stop, count = self._model.stop, self._count
        says_so = self._model.guard == STOPPED and not self._model.silent(monotonic_ns())
        if stop is None or count.complete or (says_so and not count.several):
            return
        stop.failed = ONE_SILENT if any(answer.done for answer in count.answers()) else words
        log.warning("%s: the stop is not acknowledged: %s", self._model.robot, stop.failed)
