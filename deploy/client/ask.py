"""One question to each of some robots, and what each answered: none waits for another."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress

from common.errors import CodecError, LinkError, LinkTimeoutError
from common.link import Link, open_session
from common.wire.control import ask_everybody, topic_for
from common.wire.messages import Action, ControlRequest
from deploy.client.answer import RobotAnswer
from deploy.client.destination import ROUTER_S, Destination

OTHERS_S = 0.5
"""How long a question waits for endpoints other than the robot's own."""
_NOT_THERE = "does not answer at {at}: is `tandem slave` running, with that robot name, and listening there?"
_OR_NOT_ALLOWED = (
    " Check also that [link.access] permits your certificate; the robot's log names refused ones"
)
_LATE = "is connected, but did not answer in {s:g} s: it is not known what it did; ask `tandem status`"


async def ask_robots(
    where: Destination, action: Action, key: str = "", groups: Sequence[str] = ()
) -> list[RobotAnswer]:
    """The answers, in the robots' order. Raises LinkError where the link cannot be opened at all."""
    async with open_session(where.link, router_within_s=ROUTER_S) as session:
        links = [session.link(robot) for robot in where.robots]
        each = await asyncio.gather(*(ask(link, where, action, key, groups) for link in links))
    return [answer for answers in each for answer in answers]


async def ask(
    link: Link, where: Destination, action: Action, key: str = "", groups: Sequence[str] = ()
) -> list[RobotAnswer]:
    """What the robots of one name answer, or that none did: at least one. It never raises for their absence.

    Where several bear the name, nothing that could move one is asked of any.
    """
    topic = topic_for(action, where.operator)
    try:
        await link.connected(topic)
    except LinkTimeoutError:
        text = _NOT_THERE.format(at=", ".join(where.link.connect))
        return [RobotAnswer(link.robot, False, text + (_OR_NOT_ALLOWED if where.link.tls else ""))]
    await _until_all_are_connected(link, where)

    async def ask_all(payload: bytes) -> list[bytes]:
        return [answer.payload for answer in await link.ask_all(topic, payload)]

    try:
        request = ControlRequest(link.robot, action, where.operator, key, groups=tuple(groups))
        replies = await ask_everybody(ask_all, request)
    except LinkTimeoutError:
        return [RobotAnswer(link.robot, False, _LATE.format(s=topic.timeout_s))]
    except (LinkError, CodecError) as error:
        return [RobotAnswer(link.robot, False, str(error))]
    several = len(replies) > 1
    return [
        RobotAnswer(
            link.robot, each.done, each.text, each.guard, each.instance, each.place if several else ""
        )
        for each in replies
    ]


async def _until_all_are_connected(link: Link, where: Destination) -> None:
    """A namesake may be behind an endpoint that is slower to answer than the robot that is asked for."""
    doors = 1 if where.link.mode == "client" else len(where.link.connect)
    with suppress(TimeoutError):
        async with asyncio.timeout(OTHERS_S):
            while link.peers < doors:  # noqa: ASYNC110
                await asyncio.sleep(0.02)
