"""An emergency stop that is repeated until the robot has acknowledged it, or the time is up.

A lost question must not be the end of it, nor an answer that is waited for: a new one leaves every
REPEAT_S, whatever became of those before. To stop twice is harmless.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from common.codec import decode, encode
from common.errors import CodecError, LinkError
from common.link import Session, open_session
from common.messages import Action, ControlReply, ControlRequest
from common.topics import STOP
from deploy.control.ask import Answer
from deploy.control.reach import Reach

REPEAT_S = 0.2
WITHIN_S = 5.0
SETTLE_S = 0.5
"""After the last endpoint is connected: a robot there shows itself within milliseconds."""
STOPPED = "estop"

Ask = Callable[[bytes], Awaitable[bytes]]
Tell = Callable[[Answer], None]


async def repeat_until_stopped(
    ask: Ask, request: ControlRequest, within_s: float = WITHIN_S, repeat_s: float = REPEAT_S
) -> ControlReply | None:
    """The reply of a robot that says it is stopped; None where none came in time."""
    under_way: set[asyncio.Task[ControlReply | None]] = set()
    payload = encode(request)
    try:
        async with asyncio.timeout(within_s):
            while True:
                under_way.add(asyncio.create_task(_ask_once(ask, payload)))
                reply = await _acknowledged(under_way, repeat_s)
                if reply is not None:
                    return reply
    except TimeoutError:
        return None
    finally:
        for task in under_way:
            task.cancel()


async def _ask_once(ask: Ask, payload: bytes) -> ControlReply | None:
    try:
        reply = decode(await ask(payload), ControlReply)
    except (LinkError, CodecError):
        return None
    return reply if reply.done and reply.guard == STOPPED else None


async def _acknowledged(
    under_way: set[asyncio.Task[ControlReply | None]], for_s: float
) -> ControlReply | None:
    """The first acknowledgement of any question that is under way; None when the time is up."""
    loop = asyncio.get_running_loop()
    until_s = loop.time() + for_s
    while (left_s := until_s - loop.time()) > 0:
        if not under_way:
            await asyncio.sleep(left_s)  # all failed at once: nobody is there yet
            return None
        done, _ = await asyncio.wait(under_way, timeout=left_s, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            under_way.discard(task)
            if (reply := task.result()) is not None:
                return reply
    return None


async def stop_robots(
    where: Reach, everyone: bool, tell: Tell = lambda _: None, within_s: float = WITHIN_S
) -> list[Answer]:
    """Stop the named robots and, with `everyone`, all that show themselves at the endpoints.

    `tell` hears each answer as soon as it is known. An endpoint where no robot showed itself is an answer
    that is not done. Raises LinkError where the link cannot be opened at all.
    """
    endpoints = where.link.connect
    # through routers one that answers is all: it leads to every robot
    doors = 1 if where.link.mode == "client" else len(endpoints)
    async with open_session(where.link, router_within_s=within_s) as session:
        stopping = _Stopping(session, where.operator, tell, within_s)
        for robot in where.robots:
            stopping.stop(robot)
        if everyone:
            session.watch_robots(lambda robot, alive: stopping.stop(robot) if alive else None)
            await _until_all_showed(session, doors, within_s)
        answers = await stopping.answers()
        missing = doors - session.peers
        if everyone and missing > 0:
            many = f"{missing} of {doors} endpoints"
            text = f"NOT REACHED: {many} ({', '.join(endpoints)}); whoever is there is not stopped"
            answers.append(Answer("", False, text))
            tell(answers[-1])
        elif everyone and not answers:
            answers.append(Answer("", False, "NOBODY STOPPED: no robot showed itself at the endpoints"))
            tell(answers[-1])
    return answers


class _Stopping:
    """The stops under way, one a robot."""

    def __init__(self, session: Session, operator: str, tell: Tell, within_s: float) -> None:
        self._session = session
        self._operator = operator
        self._tell = tell
        self._within_s = within_s
        self._tasks: dict[str, asyncio.Task[Answer]] = {}

    def stop(self, robot: str) -> None:
        """Begin to stop a robot, once."""
        if robot not in self._tasks:
            self._tasks[robot] = asyncio.create_task(self._stop(robot))

    async def answers(self) -> list[Answer]:
        """All of them, by name."""
        await asyncio.gather(*self._tasks.values())
        return [self._tasks[robot].result() for robot in sorted(self._tasks)]

    async def _stop(self, robot: str) -> Answer:
        link = self._session.link(robot)
        request = ControlRequest(robot, Action.ESTOP, self._operator)
        reply = await repeat_until_stopped(lambda p: link.ask(STOP, p), request, self._within_s)
        if reply is None:
            text = f"NOT STOPPED by this: no answer within {self._within_s:g} s. Stop it at the robot itself"
            answer = Answer(robot, False, text)
        else:
            answer = Answer(robot, True, reply.text, reply.guard)
        self._tell(answer)
        return answer


async def _until_all_showed(session: Session, endpoints: int, within_s: float) -> None:
    loop = asyncio.get_running_loop()
    until_s = loop.time() + within_s
    while session.peers < endpoints and loop.time() < until_s:  # noqa: ASYNC110
        await asyncio.sleep(0.05)
    await asyncio.sleep(SETTLE_S)
