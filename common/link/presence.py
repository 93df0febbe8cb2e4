"""Hears which processes are alive, from their liveliness tokens."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import zenoh
from zenoh.handlers import Callback

from common.link.declared import Declarations
from common.link.inbox import wake
from common.wire.presence import ProcessPresence, read_presence
from common.wire.topics import ALIVE


def watch_presence(
    declared: Declarations,
    loop: asyncio.AbstractEventLoop,
    robot: str,
    on_change: Callable[[ProcessPresence, bool], None],
) -> None:
    """Call `on_change(presence, alive)` on the loop; those already there at once. `robot` may be `*`.

    A key that is no token of tandem is ignored. In a new session all have gone first, and come anew.
    """
    here: dict[str, ProcessPresence] = {}

    def on_sample(sample: zenoh.Sample) -> None:
        key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        presence = read_presence(key)
        if presence is None:
            return
        if alive:
            here[key] = presence
        else:
            here.pop(key, None)
        wake(loop, on_change, presence, alive)

    def declare(session: zenoh.Session) -> object:
        for presence in list(here.values()):
            wake(loop, on_change, presence, False)
        here.clear()
        return session.liveliness().declare_subscriber(
            f"{ALIVE.key_for(robot)}/**", Callback(on_sample, indirect=False), history=True
        )

    declared.add(declare)
