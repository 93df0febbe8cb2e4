"""Heeds the revocation list while a process runs: tells who is revoked, and cuts open sessions off.

Zenoh 1.10 can neither close one peer's session nor change its rules: the whole session is opened anew, with
rules that refuse the revoked. Nobody else shall suffer for a name that is not connected: it is only when one
is, or connects, that this happens.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

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
    connected = Connected()
    session.watch_peers(connected.on_change)
    task = asyncio.create_task(_heed(session, revocations, connected, open_again))
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


class Connected:
    """Whose certificates the sessions show that are connected now."""

    def __init__(self) -> None:
        self._links: Counter[str] = Counter()
        self.changed = asyncio.Event()

    def on_change(self, _: str, name: str, here: bool) -> None:
        """A link came or went."""
        self._links[name] += 1 if here else -1
        self.changed.set()

    @property
    def names(self) -> frozenset[str]:
        """Their common names."""
        return frozenset(name for name, count in self._links.items() if count > 0)


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
