"""Robots are asked side by side; each answers for itself, and one that is not there is said to be so."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import AsyncExitStack
from typing import Any

import pytest

from common.errors import LinkTimeoutError
from common.link import open_link, open_session
from common.link.config import LinkConfig
from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.topics import CONTROL, STOP, Topic
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask, ask_robots
from deploy.client.destination import Destination


def endpoint() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_each_robot_answers_for_itself() -> None:
    asked: list[ControlRequest] = []

    def willing(payload: bytes, _: int) -> bytes:
        asked.append(decode(payload, ControlRequest))
        return encode(ControlReply(True, "align", "moves slowly", challenge=5))

    def unwilling(payload: bytes, _: int) -> bytes:
        return encode(ControlReply(False, "estop", "the e-stop is latched: reset it first"))

    async def story() -> list[RobotAnswer]:
        at = [endpoint(), endpoint()]
        async with (
            open_link(LinkConfig(listen=[at[0]]), "a") as a,
            open_link(LinkConfig(listen=[at[1]]), "b") as b,
        ):
            a.answer(CONTROL, willing)
            b.answer(CONTROL, unwilling)
            return await ask_robots(
                Destination(LinkConfig(connect=at), ("a", "b", "c"), "anna"), Action.ENGAGE
            )

    a, b, c = asyncio.run(story())
    assert a == RobotAnswer("a", True, "moves slowly", "align")
    assert b == RobotAnswer("b", False, "the e-stop is latched: reset it first", "estop")
    assert (c.done, c.guard) == (False, "")
    assert "is `tandem slave` running" in c.text
    assert [(r.robot, r.action, r.operator, r.challenge) for r in asked] == [
        ("a", Action.STATUS, "anna", 0),
        ("a", Action.ENGAGE, "anna", 5),
    ]


class Hanging:
    """A link to a robot that is there, and does not answer."""

    robot = "a"

    async def connected(self, topic: Topic) -> None: ...

    peers = 1

    async def ask_all(self, topic: Topic, payload: bytes) -> list[Any]:
        raise LinkTimeoutError("no answer within 1 s")


def test_a_robot_that_is_there_but_gives_no_answer_may_have_done_it() -> None:
    link: Any = Hanging()
    (answer,) = asyncio.run(ask(link, Destination(LinkConfig(), ("a",), "anna"), Action.DISENGAGE))
    assert (answer.done, answer.guard) == (False, "")
    assert "it is not known what it did" in answer.text


@pytest.mark.parametrize("through_a_router", [False, True])
def test_while_two_bear_one_name_nothing_that_moves_is_asked_of_either(through_a_router: bool) -> None:
    asked: list[Action] = []

    def robot(instance: int) -> Callable[[bytes, int], bytes]:
        def answer(payload: bytes, _: int) -> bytes:
            asked.append(decode(payload, ControlRequest).action)
            place = f"room {instance}"
            return encode(ControlReply(True, "hold", "waits", challenge=5, instance=instance, place=place))

        return answer

    async def story() -> list[list[RobotAnswer]]:
        at = [endpoint(), endpoint()]
        async with AsyncExitStack() as stack:
            links = [LinkConfig(listen=[each]) for each in at]
            where = LinkConfig(connect=at)
            if through_a_router:
                await stack.enter_async_context(open_session(LinkConfig(listen=[at[0]]), "router"))
                where = LinkConfig(connect=[at[0]], mode="client")
                links = [where, where]
            for instance, link in enumerate(links, 1):
                one = await stack.enter_async_context(open_link(link, "a"))
                one.answer(CONTROL, robot(instance))
                one.answer(STOP, robot(instance))
            acts = (Action.STATUS, Action.ENGAGE, Action.RESET, Action.DISENGAGE)
            return [await ask_robots(Destination(where, ("a",), "anna"), action) for action in acts]

    status, engage, reset, disengage = asyncio.run(story())
    assert sorted((answer.instance, answer.done) for answer in status) == [(1, True), (2, True)]
    for refused in (engage, reset):
        assert [answer.done for answer in refused] == [False, False]
        assert "room 1 (instance 00000001) and room 2 (instance 00000002)" in refused[0].text
    assert [answer.done for answer in disengage] == [True, True]
    assert Action.ENGAGE not in asked
    assert Action.RESET not in asked
