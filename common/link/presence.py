"""Hears which processes are alive, from their liveliness tokens."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import zenoh
from zenoh.handlers import Callback

from common.link.inbox import wake
from common.wire.presence import ProcessPresence, read_presence
from common.wire.topics import ALIVE


def watch_presence(
    session: zenoh.Session,
    loop: asyncio.AbstractEventLoop,
    robot: str,
    on_change: Callable[[ProcessPresence, bool], None],
    held: list[object],
) -> None:
    """Call `on_change(presence, alive)` on the loop; those already there at once. `robot` may be `*`.

    A key that is no token of tandem is ignored. The subscriber is added to `held`, which keeps it alive.
    """

    def on_sample(sample: zenoh.Sample) -> None:
        presence = read_presence(str(sample.key_expr))
        if presence is not None:
            wake(loop, on_change, presence, sample.kind == zenoh.SampleKind.PUT)

    held.append(
        session.liveliness().declare_subscriber(
            f"{ALIVE.key_for(robot)}/**", Callback(on_sample, indirect=False), history=True
        )
    )
