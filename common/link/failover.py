"""A client whose router fell silent goes on by another one, without waiting for the silent one.

Zenoh tries a client's endpoints again in the order of the list, one after the other. If the first one's host
is switched off, it waits `open_timeout_s` for it. So another session is opened meanwhile, the list read from
its end; whichever connects first is kept.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

import zenoh

from common.link.config import LinkConfig
from common.link.connected import Connected, heeded_by
from common.link.link_session import LinkSession
from common.link.opening import in_turn, open_once

GRACE_S = 0.1
"""A router whose process ended refuses at once, and Zenoh is at the next one within this time by itself."""
PAUSE_S, MOST_PAUSE_S = 0.5, 5.0
"""Between attempts while no router answers: Zenoh itself tries on, with shorter pauses."""
OpenOnce = Callable[[LinkConfig, frozenset[str]], Awaitable[zenoh.Session]]

log = logging.getLogger(__name__)


@asynccontextmanager
async def failing_over(
    session: LinkSession, config: LinkConfig, open_other: OpenOnce = open_once
) -> AsyncIterator[None]:
    """Within it a client with several routers changes to one that answers as soon as its own is silent."""
    if config.mode != "client" or len(config.connect) < 2:
        yield
        return
    async with heeded_by(session, lambda connected: _watch(session, config, connected, open_other)):
        yield


async def _watch(
    session: LinkSession, config: LinkConfig, connected: Connected, open_other: OpenOnce
) -> None:
    backwards = config.model_copy(update={"connect": config.connect[::-1]})
    while True:
        await _until(connected, here=True)
        await _until(connected, here=False)
        await asyncio.sleep(GRACE_S)
        turn, pause_s = 0, PAUSE_S
        while not connected.names:
            refused = session.revoked
            found = await _before(connected, open_other(in_turn(backwards, turn), refused))
            if found is not None and await session.replace(found, refused, lambda: not connected.names):
                log.warning("the router is silent: connected again by another one of %s", config.connect)
                break
            turn += 1
            with suppress(TimeoutError):
                async with asyncio.timeout(pause_s):
                    await _until(connected, here=True)
            pause_s = min(MOST_PAUSE_S, 2.0 * pause_s)


async def _until(connected: Connected, here: bool) -> None:
    while bool(connected.names) != here:
        connected.changed.clear()
        await connected.changed.wait()


async def _before(connected: Connected, opening: Awaitable[zenoh.Session]) -> zenoh.Session | None:
    """The session that was opened; None where it was not, or where the old one is connected again before."""
    opened, again = asyncio.ensure_future(opening), asyncio.ensure_future(_until(connected, here=True))
    try:
        await asyncio.wait({opened, again}, return_when=asyncio.FIRST_COMPLETED)
        if not opened.done():
            return None
        return await opened
    except zenoh.ZError as error:
        log.debug("no other router: %s", error)
        return None
    finally:
        opened.cancel()
        again.cancel()
