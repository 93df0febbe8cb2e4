"""Hears which processes are alive, from their liveliness tokens."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import TypeVar

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.link.declared import Declarations
from common.link.inbox import wake
from common.log.throttle import LogThrottle
from common.wire.presence import (
    OperatorPresence,
    ProcessPresence,
    operator_alive_key,
    read_operator_presence,
    read_presence,
)
from common.wire.topics import ALIVE

Shown = TypeVar("Shown")
MOST_OF_ALL, MOST_OF_ONE = 65_536, 128
"""Tokens that are followed, of all robots and of one name; each process shows two. Without access rules
anybody may show any number, and every table that is made of them would grow without end."""

log = logging.getLogger(__name__)


def watch_presence(
    declared: Declarations,
    loop: asyncio.AbstractEventLoop,
    robot: str,
    on_change: Callable[[ProcessPresence, bool], None],
) -> int:
    """Call `on_change(presence, alive)` on the loop; those already there at once. `robot` may be `*`.

    A key that is no token of tandem is ignored. In a new session all have gone first, and come anew. Returns
    the declaration's number.
    """
    most = MOST_OF_ALL if robot == "*" else MOST_OF_ONE
    return _watch(declared, loop, f"{ALIVE.key_for(robot)}/**", read_presence, on_change, most)


def watch_operators(
    declared: Declarations,
    loop: asyncio.AbstractEventLoop,
    on_change: Callable[[OperatorPresence, bool], None],
) -> int:
    """As `watch_presence`, of the masters of all operators."""
    return _watch(
        declared, loop, f"{operator_alive_key('*')}/**", read_operator_presence, on_change, MOST_OF_ALL
    )


def _watch(
    declared: Declarations,
    loop: asyncio.AbstractEventLoop,
    keys: str,
    read: Callable[[str], Shown | None],
    on_change: Callable[[Shown, bool], None],
    most: int,
) -> int:
    here: dict[str, Shown] = {}
    throttle = LogThrottle()

    def on_sample(sample: zenoh.Sample) -> None:
        key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        presence = read(key)
        if presence is None:
            return
        if alive and key not in here and len(here) >= most:
            if throttle.passes(monotonic_ns()):
                log.warning("%s: more than %d liveliness tokens: the others are not followed", keys, most)
            return
        if alive:
            here[key] = presence
        elif here.pop(key, None) is None:
            return
        wake(loop, on_change, presence, alive)

    def declare(session: zenoh.Session) -> object:
        for presence in list(here.values()):
            wake(loop, on_change, presence, False)
        here.clear()
        on_this = declared.only_of(session, on_sample)
        return session.liveliness().declare_subscriber(keys, Callback(on_this, indirect=False), history=True)

    return declared.add(declare)
