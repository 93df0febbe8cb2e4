"""A client whose router fell silent: another session is opened, and whichever connects first is kept."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
import zenoh

from common.link import failover
from common.link.config import LinkConfig
from common.link.failover import failing_over

FIRST, SECOND = "tcp/192.0.2.1:7447", "tcp/192.0.2.2:7447"
CLIENT = LinkConfig(mode="client", connect=[FIRST, SECOND])


class Standing:
    """In the place of a LinkSession: who is connected, and what it was replaced by."""

    def __init__(self) -> None:
        self.revoked: frozenset[str] = frozenset()
        self.replaced: list[object] = []
        self.on_change: Callable[[str, str, bool], None] | None = None
        self.left = 0
        """Tasks that still ran at the end."""

    def watch_peers(self, on_change: Callable[[str, str, bool], None]) -> None:
        self.on_change = on_change
        on_change("router", "", True)

    def connected(self, here: bool) -> None:
        assert self.on_change is not None
        self.on_change("router", "", here)

    async def replace(self, opened: object, refused: frozenset[str], needed: Callable[[], bool]) -> bool:
        if needed():
            self.replaced.append(opened)
            self.connected(True)
            return True
        return False


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GRACE_S", "PAUSE_S", "MOST_PAUSE_S"):
        monkeypatch.setattr(failover, name, 0.0)


async def some_turns() -> None:
    for _ in range(50):
        await asyncio.sleep(0)


def story(
    config: LinkConfig, opening: Callable[[LinkConfig], Awaitable[object]], then: Callable[[Standing], Any]
) -> tuple[Standing, list[LinkConfig]]:
    """What was tried and kept after the router fell silent; `then` happens a little later."""
    tried: list[LinkConfig] = []
    session: Any = Standing()

    async def open_other(asked: LinkConfig, _: frozenset[str]) -> Any:
        tried.append(asked)
        return await opening(asked)

    @asynccontextmanager
    async def watched() -> Any:
        async with failing_over(session, config, open_other):
            await some_turns()
            yield

    async def run() -> None:
        async with watched():
            assert not tried, "its router is there"
            if session.on_change is not None:
                session.connected(False)
            await some_turns()
            then(session)
            await some_turns()
            session.left = len(asyncio.all_tasks()) - 2  # this one, and the watch

    asyncio.run(run())
    return session, tried


async def opens(_: LinkConfig) -> object:
    return "another session"


def test_another_session_is_opened_from_the_end_of_the_list() -> None:
    session, tried = story(CLIENT, opens, lambda _: None)
    assert session.replaced == ["another session"]
    assert [asked.connect for asked in tried] == [[SECOND, FIRST]]


def test_nothing_is_replaced_where_the_old_one_connects_first() -> None:
    async def lasts(_: LinkConfig) -> object:
        await asyncio.Event().wait()
        return "too late"

    session, tried = story(CLIENT, lasts, lambda one: one.connected(True))
    assert (len(tried), session.replaced, session.left) == (1, [], 0), "the attempt has ended"


def test_it_tries_until_one_answers_and_a_slow_line_gets_more_time() -> None:
    left = [5]

    async def fails(_: LinkConfig) -> object:
        left[0] -= 1
        if left[0]:
            raise zenoh.ZError("Unable to connect to any of [..]")
        return "at last"

    session, tried = story(CLIENT, fails, lambda _: None)
    assert session.replaced == ["at last"]
    assert [asked.connect[0] for asked in tried] == [SECOND, FIRST, SECOND, FIRST, SECOND]
    assert [asked.open_timeout_s for asked in tried] == [1.5, 1.5, 4.5, 4.5, 1.5]


@pytest.mark.parametrize(
    "config", [LinkConfig(mode="client", connect=[FIRST]), LinkConfig(connect=[FIRST, SECOND])]
)
def test_who_has_one_router_or_none_is_left_to_zenoh(config: LinkConfig) -> None:
    session, tried = story(config, opens, lambda _: None)
    assert (session.on_change, tried) == (None, [])
