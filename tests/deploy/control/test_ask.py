"""Robots are asked side by side; each answers for itself, and one that is not there is said to be so."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

from common.codec import decode, encode
from common.config import LinkConfig
from common.errors import LinkTimeoutError
from common.link import open_link
from common.messages import Action, ControlReply, ControlRequest
from common.topics import CONTROL, Topic
from deploy.control.ask import Answer, ask, ask_robots
from deploy.control.reach import Reach


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

    async def story() -> list[Answer]:
        at = [endpoint(), endpoint()]
        async with (
            open_link(LinkConfig(listen=[at[0]]), "a") as a,
            open_link(LinkConfig(listen=[at[1]]), "b") as b,
        ):
            a.answer(CONTROL, willing)
            b.answer(CONTROL, unwilling)
            return await ask_robots(Reach(LinkConfig(connect=at), ("a", "b", "c"), "anna"), Action.ENGAGE)

    a, b, c = asyncio.run(story())
    assert a == Answer("a", True, "moves slowly", "align")
    assert b == Answer("b", False, "the e-stop is latched: reset it first", "estop")
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

    async def ask(self, topic: Topic, payload: bytes) -> bytes:
        raise LinkTimeoutError("no answer within 1 s")


def test_a_robot_that_is_there_but_gives_no_answer_may_have_done_it() -> None:
    link: Any = Hanging()
    answer = asyncio.run(ask(link, Reach(LinkConfig(), ("a",), "anna"), Action.DISENGAGE))
    assert (answer.done, answer.guard) == (False, "")
    assert "what it did is not known" in answer.text
