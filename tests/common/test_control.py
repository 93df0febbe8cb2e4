"""A request that could move a robot asks for its status first and quotes what that gave."""

import asyncio

import pytest

from common.codec import decode, encode
from common.control import CHALLENGED, ask_control
from common.messages import Action, ControlReply, ControlRequest


class Robot:
    def __init__(self) -> None:
        self.heard: list[ControlRequest] = []

    async def ask(self, payload: bytes) -> bytes:
        self.heard.append(decode(payload, ControlRequest))
        given = 7 if self.heard[-1].action is Action.STATUS else 0
        return encode(ControlReply(True, "hold", self.heard[-1].action, challenge=given))


@pytest.mark.parametrize("action", Action)
def test_only_what_could_move_it_asks_twice(action: Action) -> None:
    robot = Robot()
    request = ControlRequest("robot-1", action, "anna", "key")
    reply = asyncio.run(ask_control(robot.ask, request))
    assert reply.text == action
    if action in CHALLENGED:
        status, asked = robot.heard
        assert (status.action, status.operator, status.key) == (Action.STATUS, "anna", "")
        assert (asked.action, asked.key, asked.challenge) == (action, "key", 7)
    else:
        assert robot.heard == [request]
