"""Who is connected, by the certificates that a link's sessions show, and what runs beside them to heed it."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

from common.link.link_session import LinkSession


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


@asynccontextmanager
async def heeded_by(
    session: LinkSession, heed: Callable[[Connected], Awaitable[None]]
) -> AsyncIterator[None]:
    """Within it `heed` runs in the same loop, told who is connected."""
    connected = Connected()
    session.watch_peers(connected.on_change)
    task = asyncio.ensure_future(heed(connected))
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
