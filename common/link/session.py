"""Opens the session of a process: its keys checked, its revocation list heeded, closed at the end."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial

import zenoh

from common.errors import LinkError
from common.link.certificates import check_keys
from common.link.config import LinkConfig
from common.link.congestion import check_congestion_control, set_congestion_control
from common.link.failover import failing_over
from common.link.link import Link
from common.link.link_session import LinkSession, check_robot_name
from common.link.paths import open_paths
from common.link.revoked import RevocationFile
from common.link.revoking import heeding


@asynccontextmanager
async def open_session(
    config: LinkConfig,
    mode: str = "",
    router_within_s: float = math.inf,
    waits: Callable[[str], None] = lambda _: None,
) -> AsyncIterator[LinkSession]:
    """A session for any robots' links. Raises LinkError where it cannot be opened; a peer may come later.

    `mode`: `router`, in place of the configuration's own. `router_within_s`: how long it waits for a router,
    or for an address to listen at; a robot waits for ever, a command does not. `waits` takes, now and then,
    the reason for which it waits.
    """
    if not (config.listen or config.connect):
        raise LinkError("the link has no endpoint: set `listen` or `connect` under [link]")
    check_keys(config)
    algorithm = config.tcp_congestion_control
    if algorithm is not None:
        check_congestion_control(algorithm)
    revocations = None if config.revoked is None else RevocationFile(config.revoked)
    revoked = revocations.names if revocations else frozenset()
    opened = await open_paths(config, mode, router_within_s, waits, revoked)
    session = LinkSession(opened, asyncio.get_running_loop(), config.quality, revoked)
    if algorithm is not None:
        set_congestion_control(algorithm)  # what the listening sockets accept inherits it
        session.watch_peers(partial(_choose_congestion, algorithm))

    async def open_again(refused: frozenset[str]) -> zenoh.Session:
        return await open_paths(config, mode, math.inf, waits, refused)

    try:
        async with heeding(session, revocations, open_again), failing_over(session, config):
            yield session
    finally:
        await session.close()


def _choose_congestion(algorithm: str, *_: object) -> None:
    set_congestion_control(algorithm)


@asynccontextmanager
async def open_link(config: LinkConfig, robot: str) -> AsyncIterator[Link]:
    """A session for one robot alone. Raises LinkError where it cannot be opened; a peer may come later."""
    check_robot_name(robot)
    async with open_session(config) as session:
        yield session.link(robot)
