"""Requests to a robot. One that could move it quotes a number that the robot gave a moment ago."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace

from common.errors import CodecError
from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.presence import several_bear
from common.wire.stop import pack_stop, read_stop_answer
from common.wire.topics import CONTROL, STOP, Topic

CHALLENGED = frozenset(
    {Action.ENGAGE, Action.RESET, Action.HOME, Action.TAKE_UP, Action.HANDOVER, Action.TAKE}
)
"""Requests that must not take effect late. To stop, claim, release or ask is harmless at any time."""
OPEN = frozenset({Action.ESTOP, Action.STATUS})
"""Requests allowed to every host with a certificate; all others are for the robot's operators."""


def topic_for(action: Action, operator: str) -> Topic:
    """The topic of a request: requests open to all have a key of their own, others go on the operator's.

    Access control goes by keys alone.
    """
    return STOP if action in OPEN else CONTROL.of(operator)


def request_bytes(request: ControlRequest) -> bytes:
    """The request as it travels: a stop in its own form, which no version changes."""
    if request.action is Action.ESTOP:
        return pack_stop(request.robot, request.operator)
    return encode(request)


def read_reply(payload: bytes, action: Action) -> ControlReply:
    """What was answered to such a request. Raises CodecError."""
    if action is not Action.ESTOP:
        return decode(payload, ControlReply)
    answer = read_stop_answer(payload)
    if answer is None:
        raise CodecError("not an answer to a stop")
    return ControlReply(answer.done, answer.guard, answer.text, instance=answer.instance)


async def ask_control(ask: Callable[[bytes], Awaitable[bytes]], request: ControlRequest) -> ControlReply:
    """The robot's answer. `ask` takes a request's bytes to the robot and brings back the reply's.

    Raises CodecError, and whatever `ask` raises.
    """
    if request.action in CHALLENGED:
        status = replace(request, action=Action.STATUS, key="")
        given = decode(await ask(encode(status)), ControlReply)
        request = replace(request, challenge=given.challenge)
    return read_reply(await ask(request_bytes(request)), request.action)


AskAll = Callable[[bytes], Awaitable[list[bytes]]]


async def ask_everybody(ask_all: AskAll, request: ControlRequest) -> list[ControlReply]:
    """What every robot of that name answers. If several answer, a request that could move one is not sent.

    Raises CodecError where any answer is not understood, and whatever `ask_all` raises.
    """
    if request.action in CHALLENGED:
        status = replace(request, action=Action.STATUS, key="")
        given = await _replies(ask_all, status)
        if len(given) > 1:
            text = several_bear(request.robot, [_place(reply) for reply in given])
            return [replace(reply, done=False, text=text) for reply in given]
        request = replace(request, challenge=given[0].challenge)
    return await _replies(ask_all, request)


async def _replies(ask_all: AskAll, request: ControlRequest) -> list[ControlReply]:
    """One reply an instance: a robot that is reached in two ways is one robot."""
    answers = await ask_all(request_bytes(request))
    replies = [read_reply(payload, request.action) for payload in answers]
    return list({reply.instance: reply for reply in replies}.values())


def _place(reply: ControlReply) -> str:
    return f"{reply.place or 'an unknown place'} (instance {reply.instance:08x})"
