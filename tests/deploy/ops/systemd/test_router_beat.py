"""The router's watchdog is fed by a question to Zenoh itself, which routes in threads of its own."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from common.process.notify import Notifier
from common.process.pacing import DueTick, TickGrid
from deploy.ops.router import run as router


class Sessions:
    """Three answers, then Zenoh hangs; here it raises, so that the test can go on."""

    def __init__(self) -> None:
        self.asked = 0

    @property
    def peers(self) -> int:
        self.asked += 1
        if self.asked > 3:
            raise TimeoutError
        return self.asked


def test_a_zenoh_that_hangs_is_not_taken_for_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    async def ticks(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(10):
            yield DueTick(tick, grid.origin_ns, 0)

    messages: list[bytes] = []

    def send(message: bytes) -> bool:
        messages.append(message)
        return True

    monkeypatch.setattr(router, "ticks", ticks)
    session: Any = Sessions()
    with pytest.raises(TimeoutError):
        asyncio.run(router.tend(session, Notifier(send, watchdog_ns=4)))
    assert messages[:2] == [b"STATUS=1 connected", b"READY=1\nWATCHDOG=1"]
    assert messages[2:] == [b"STATUS=2 connected", b"WATCHDOG=1", b"STATUS=3 connected", b"WATCHDOG=1"]
