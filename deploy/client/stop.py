"""An emergency stop that is repeated until every robot of that name has acknowledged it, or the time is up.

A lost question must not be the end of it, nor an answer that is waited for: a new one leaves every
REPEAT_S, whatever became of those before. To stop twice is harmless. Two robots may bear one name by
mistake: the stop asks all, and answers are counted by instance.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress

from common.errors import LinkError
from common.link import LinkSession, open_session
from common.link.queries import Answered
from common.wire.presence import ProcessPresence
from common.wire.stop import pack_stop, read_stop_answer
from common.wire.topics import STOP
from deploy.client.answer import RobotAnswer
from deploy.client.destination import Destination
from deploy.client.stop_count import StopCount

REPEAT_S = 0.2
WITHIN_S = 5.0
SETTLE_S = 0.5
"""After the last endpoint is connected: a robot there shows itself within milliseconds."""

OnAnswer = Callable[[Answered], None]
AskAll = Callable[[bytes, OnAnswer], Awaitable[object]]
ReportAnswer = Callable[[RobotAnswer], None]

log = logging.getLogger(__name__)


async def repeat_until_stopped(
    ask_all: AskAll,
    count: StopCount,
    payload: bytes,
    settled: asyncio.Event,
    report: ReportAnswer,
    repeat_s: float = REPEAT_S,
) -> None:
    """Ask until the count is complete once it is `settled` which robots there are. It ends by itself only so.

    `report` hears each acknowledgement once, as it comes.
    """
    under_way: set[asyncio.Task[None]] = set()

    def on_answer(answered: Answered) -> None:
        answer = read_stop_answer(answered.payload)
        acknowledged = None if answer is None else count.on_answer(answer, answered.replier)
        if acknowledged is not None:
            report(acknowledged)

    async def ask() -> None:
        with suppress(LinkError):
            await ask_all(payload, on_answer)

    try:
        while not (settled.is_set() and count.complete):
            under_way.add(asyncio.create_task(ask()))
            await asyncio.sleep(repeat_s)
            under_way = {task for task in under_way if not task.done()}
    finally:
        for task in under_way:
            task.cancel()


async def stop_robots(
    where: Destination, everyone: bool, report: ReportAnswer = lambda _: None, within_s: float = WITHIN_S
) -> list[RobotAnswer]:
    """Stop the named robots and, with `everyone`, all that show themselves at the endpoints.

    `report` hears each answer as soon as it is known. An endpoint where no robot showed itself is an answer
    that is not done. Raises LinkError where the link cannot be opened at all.
    """
    endpoints = where.link.connect
    # through routers one that answers is all: it leads to every robot
    doors = 1 if where.link.mode == "client" else len(endpoints)
    async with open_session(where.link, router_within_s=within_s) as session:
        stopping = _Stopping(session, where.operator, report, within_s)
        for robot in where.robots:
            stopping.stop(robot)
        session.watch_presence(lambda presence, here: stopping.on_presence(presence, here, everyone))
        await _until_all_showed(session, doors, within_s)
        missing = doors - session.peers
        stopping.settled.set()
        answers = await stopping.answers()
        if missing > 0:
            many = f"{missing} of {doors} endpoints"
            text = f"NOT REACHED: {many} ({', '.join(endpoints)}); robots there are not stopped"
            # where robots were named, each of them has answered or is said not to have
            answers.append(RobotAnswer("", not everyone, text))
            report(answers[-1])
        elif everyone and not answers:
            answers.append(RobotAnswer("", False, "NO ROBOT STOPPED: no robot was found at the endpoints"))
            report(answers[-1])
    return answers


class _Stopping:
    """The stops under way, one a name."""

    def __init__(self, session: LinkSession, operator: str, report: ReportAnswer, within_s: float) -> None:
        self._session = session
        self._operator = operator
        self._report = report
        self._within_s = within_s
        self.settled = asyncio.Event()
        """Set when every process at the endpoints has had the time to announce itself."""
        self._counts: dict[str, StopCount] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    def on_presence(self, presence: ProcessPresence, here: bool, everyone: bool) -> None:
        """A process announced itself: stop it if its robot is named, or if all robots are to stop."""
        if presence.role != "slave" or not here:
            return
        if everyone:
            self.stop(presence.robot)
        if presence.robot in self._counts:
            self._counts[presence.robot].expect(presence)

    def stop(self, robot: str) -> None:
        """Begin to stop all robots of a name, once."""
        if robot not in self._tasks:
            self._counts[robot] = StopCount(robot, self._within_s)
            self._tasks[robot] = asyncio.create_task(self._stop(robot))

    async def answers(self) -> list[RobotAnswer]:
        """All of them, by name."""
        await asyncio.gather(*self._tasks.values())
        return [answer for robot in sorted(self._counts) for answer in self._counts[robot].answers()]

    async def _stop(self, robot: str) -> None:
        link = self._session.link(robot)
        count, payload = self._counts[robot], pack_stop(robot, self._operator)

        async def ask_all(question: bytes, on_answer: OnAnswer) -> object:
            return await link.ask_all(STOP, question, on_answer)

        with suppress(TimeoutError):
            async with asyncio.timeout(self._within_s):
                await repeat_until_stopped(ask_all, count, payload, self.settled, self._report)
        for answer in count.failures():
            self._report(answer)
        if (namesakes := count.namesakes()) is not None:
            log.warning("%s", namesakes)


async def _until_all_showed(session: LinkSession, endpoints: int, within_s: float) -> None:
    loop = asyncio.get_running_loop()
    until_s = loop.time() + within_s
    while session.peers < endpoints and loop.time() < until_s:  # noqa: ASYNC110
        await asyncio.sleep(0.05)
    await asyncio.sleep(SETTLE_S)
