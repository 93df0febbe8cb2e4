"""A request that could move a robot asks for its status first and quotes what that gave."""

import asyncio

import pytest

from common.errors import CodecError
from common.wire.codec import decode, encode
from common.wire.control import CHALLENGED, ask_control, read_reply
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.stop import StopAnswer, pack_stop, pack_stop_answer


class Robot:
    def __init__(self) -> None:
        self.heard: list[ControlRequest] = []

    async def ask(self, payload: bytes) -> bytes:
        self.heard.append(decode(payload, ControlRequest))
        given = 7 if self.heard[-1].action is Action.STATUS else 0
        return encode(ControlReply(True, "hold", self.heard[-1].action, challenge=given))


def test_a_stop_goes_in_its_own_form_and_is_answered_in_it() -> None:
    asked: list[bytes] = []

    async def ask(payload: bytes) -> bytes:
        asked.append(payload)
        return pack_stop_answer(StopAnswer(True, "estop", "stopped", 9))

    reply = asyncio.run(ask_control(ask, ControlRequest("robot-1", Action.ESTOP, "anna")))
    assert asked == [pack_stop("robot-1", "anna")]
    assert (reply.done, reply.guard, reply.instance) == (True, "estop", 9)
    with pytest.raises(CodecError, match="not an answer to a stop"):
        read_reply(encode(ControlReply(True, "estop", "stopped")), Action.ESTOP)


@pytest.mark.parametrize("action", sorted(set(Action) - {Action.ESTOP}))
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
