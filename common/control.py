"""How to ask a robot: what could move it quotes a number that the robot gave a moment ago."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace

from common.codec import decode, encode
from common.messages import Action, ControlReply, ControlRequest
from common.topics import CONTROL, STOP, Topic

CHALLENGED = frozenset({Action.ENGAGE, Action.RESET})
"""Requests that must not take effect late. To stop, claim, release or ask is harmless at any time."""


OPEN = frozenset({Action.ESTOP, Action.STATUS})
"""Requests that anybody may make who has a certificate; all others are for the robot's operators."""


def topic_for(action: Action) -> Topic:
    """Where a request goes: what everybody may ask has a key of its own, as access control goes by keys."""
    return STOP if action in OPEN else CONTROL


async def ask_control(ask: Callable[[bytes], Awaitable[bytes]], request: ControlRequest) -> ControlReply:
    """The robot's answer. `ask` takes a request's bytes to the robot and brings back the reply's.

    Raises CodecError, and whatever `ask` raises.
    """
    if request.action in CHALLENGED:
        status = replace(request, action=Action.STATUS, key="")
        given = decode(await ask(encode(status)), ControlReply)
        request = replace(request, challenge=given.challenge)
    return decode(await ask(encode(request)), ControlReply)
