"""A session that opens after nobody waits for it any more is closed, and not on the loop."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

from common.link.opening import close_unwanted


class Hangs:
    """A session whose link leads nowhere: to close it lasts until `let_go`."""

    def __init__(self) -> None:
        self.let_go = threading.Event()
        self.closed = threading.Event()
        self.daemon: bool | None = None

    def close(self) -> None:
        self.daemon = threading.current_thread().daemon
        assert self.let_go.wait(30.0), "whoever asked it to close waited for it"
        self.closed.set()


async def opened(session: Any) -> asyncio.Future[Any]:
    future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
    future.set_result(session)
    return future


def test_a_close_that_hangs_holds_neither_the_loop_nor_the_process() -> None:
    session = Hangs()

    async def story() -> None:
        close_unwanted(await opened(session))
        assert not session.closed.is_set()

    asyncio.run(story())
    session.let_go.set()
    assert session.closed.wait(30.0)
    assert session.daemon is True


@pytest.mark.parametrize("cancelled", [True, False])
def test_what_never_opened_needs_no_closing(cancelled: bool) -> None:
    async def story() -> None:
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        if cancelled:
            future.cancel()
        else:
            future.set_exception(ValueError("no endpoint"))
        close_unwanted(future)

    before = threading.active_count()
    asyncio.run(story())
    assert threading.active_count() == before
