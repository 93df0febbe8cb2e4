"""One question to each of some robots, and what each answered: none waits for another."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from common.control import ask_control, topic_for
from common.errors import CodecError, LinkError, LinkTimeoutError
from common.link import Link, open_session
from common.messages import Action, ControlRequest
from deploy.control.reach import ROUTER_S, Reach

_NOT_THERE = "does not answer at {at}: is `tandem slave` running, with that robot name, and listening there?"
_OR_NOT_ALLOWED = " And may your certificate ask it? Its log says who was refused"
_LATE = "is there, but gave no answer in {s:g} s: what it did is not known, `tandem status` tells"


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of a request to one robot."""

    robot: str
    done: bool
    text: str
    """What happened, or why not."""
    guard: str = ""
    """The guard's state; empty where the robot did not answer."""

    @property
    def line(self) -> str:
        """For people."""
        return ": ".join(part for part in (self.robot, self.guard, self.text) if part)


async def ask_robots(where: Reach, action: Action, key: str = "") -> list[Answer]:
    """The answers, in the robots' order. Raises LinkError where the link cannot be opened at all."""
    async with open_session(where.link, router_within_s=ROUTER_S) as session:
        links = [session.link(robot) for robot in where.robots]
        return await asyncio.gather(*(ask(link, where, action, key) for link in links))


async def ask(link: Link, where: Reach, action: Action, key: str = "") -> Answer:
    """One robot's answer, or that there was none. It never raises for a robot that is not there."""
    topic = topic_for(action)
    try:
        await link.connected(topic)
    except LinkTimeoutError:
        text = _NOT_THERE.format(at=", ".join(where.link.connect))
        return Answer(link.robot, False, text + (_OR_NOT_ALLOWED if where.link.tls else ""))
    try:
        request = ControlRequest(link.robot, action, where.operator, key)
        reply = await ask_control(lambda payload: link.ask(topic, payload), request)
    except LinkTimeoutError:
        return Answer(link.robot, False, _LATE.format(s=topic.timeout_s))
    except (LinkError, CodecError) as error:
        return Answer(link.robot, False, str(error))
    return Answer(link.robot, reply.done, reply.text, reply.guard)
