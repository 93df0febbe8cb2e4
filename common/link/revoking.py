"""Heeds the revocation list while a process runs: tells who is revoked, and cuts open sessions off.

Zenoh 1.10 can neither close one peer's session nor change its rules: the whole session is opened anew, with
rules that refuse the revoked. Nobody else shall suffer for a name that is not connected: it is only when one
is, or connects, that this happens.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from common.link.connected import Connected, heeded_by
from common.link.link_session import LinkSession, OpenAgain
from common.link.revoked import EVERY_S, RevocationFile

log = logging.getLogger(__name__)


@asynccontextmanager
async def heeding(
    session: LinkSession, revocations: RevocationFile | None, open_again: OpenAgain
) -> AsyncIterator[None]:
    """Within it the list, if there is one, is read again and again, and its names are cut off."""
    if revocations is None:
        yield
        return
    async with heeded_by(session, lambda connected: _heed(session, revocations, connected, open_again)):
        yield


def to_cut(connected: frozenset[str], revoked: frozenset[str], refused: frozenset[str]) -> frozenset[str]:
    """For whom the session must be opened anew: connected, and treated wrongly by its rules. Pure."""
    return connected & (revoked ^ refused)


async def _heed(
    session: LinkSession, revocations: RevocationFile, connected: Connected, open_again: OpenAgain
) -> None:
    loop = asyncio.get_running_loop()
    look_s = loop.time()
    while True:
        if loop.time() >= look_s:
            look_s = loop.time() + EVERY_S
            trouble = await asyncio.to_thread(revocations.look)
            if trouble:
                log.warning("%s; the list of before stays in force", trouble)
            if revocations.names != session.revoked:
                log.warning("revoked now: %s", ", ".join(sorted(revocations.names)) or "nobody")
                session.revoke(revocations.names)
        cut = to_cut(connected.names, session.revoked, session.refused)
        if cut:
            log.warning("the link is opened anew, as %s may do something else now", ", ".join(sorted(cut)))
            await session.reopen(open_again)
        connected.changed.clear()
        with suppress(TimeoutError):
            async with asyncio.timeout(max(0.0, look_s - loop.time())):
                await connected.changed.wait()
