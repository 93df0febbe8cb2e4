"""A second path whose declarations fail half-way: not in use until it holds all, and tried again."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
import zenoh
from zenoh.handlers import Callback

from common.link import paths
from common.link.config import LinkConfig, TwinConfig
from common.link.paths import _Opening
from common.link.twin_session import TwinSession

KEYS = ["state", "summary", "video"]


class Part:
    """What a session holds."""

    def undeclare(self) -> None: ...


class OnePath:
    """Stands for a zenoh.Session that refuses a key so many times."""

    def __init__(self, refuses: str = "", times: int = 0) -> None:
        self.refuses, self.times = refuses, times
        self.declared: list[str] = []
        self.closed = False

    def declare_subscriber(self, key: str, _: object) -> Part:
        if key == self.refuses and self.times:
            self.times -= 1
            raise zenoh.ZError("no more resources")
        self.declared.append(key)
        return Part()

    def close(self) -> None:
        self.closed = True


def twin_of(session: Any) -> TwinSession:
    twin = TwinSession({0: session}, ("path a", "path b"))
    for key in KEYS:
        twin.declare_subscriber(key, Callback(lambda _: None, indirect=False))
    twin.missing = {1: "is not there"}
    return twin


def opening_of(within_s: float) -> _Opening:
    ends = (LinkConfig(listen=["tcp/1.2.3.4:1"], twin=TwinConfig(listen=["tcp/1.2.3.5:1"])),) * 2
    return _Opening(ends, "", within_s, lambda _: None, frozenset())


def test_a_path_that_lacks_a_part_is_not_in_use_and_goes_on_where_it_failed() -> None:
    first, second = OnePath(), OnePath("summary", times=1)
    unlike: Any = second

    async def story() -> None:
        twin = twin_of(first)
        with pytest.raises(zenoh.ZError):
            await twin.attach(1, unlike)
        assert twin.each == (first,), "a question would be asked where its answer has no listener"
        assert twin.missing
        assert await twin.attach(1, unlike)
        assert twin.each == (first, second)
        assert not twin.missing

    asyncio.run(story())
    assert second.declared == KEYS, "each once"


def test_what_is_declared_meanwhile_is_on_the_new_path_too() -> None:
    first, second = OnePath(), OnePath()
    unlike: Any = second

    async def story() -> None:
        twin = twin_of(first)
        attaching = asyncio.create_task(twin.attach(1, unlike))
        while "summary" not in second.declared:  # noqa: ASYNC110
            await asyncio.sleep(0)
        twin.declare_subscriber("late", Callback(lambda _: None, indirect=False))
        assert await attaching

    asyncio.run(story())
    assert first.declared == second.declared == [*KEYS, "late"]


def test_a_robot_tries_a_half_failed_path_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(paths, "MOST_RETRY_S", 0.001)
    first, second = OnePath(), OnePath("video", times=2)
    session: Any = second

    async def story() -> None:
        twin, opening = twin_of(first), opening_of(float("inf"))
        opened: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        opened.set_result(session)
        task: Any = opened
        await opening._attach_late(twin, 1, task)
        assert twin.each == (first, second)

    asyncio.run(story())
    assert second.declared == KEYS
    assert not second.closed
    assert caplog.text.count("no more resources; trying again") == 2


@pytest.mark.parametrize("within_s", [1.0, float("inf")])
def test_a_path_that_is_given_up_is_closed(monkeypatch: pytest.MonkeyPatch, within_s: float) -> None:
    """By a command, which does not look for ever; and by a robot that stops while it tries again."""
    monkeypatch.setattr(paths, "MOST_RETRY_S", 60.0)
    second = OnePath("summary", times=9)
    session: Any = second

    async def story() -> None:
        opened: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        opened.set_result(session)
        task: Any = opened
        attaching = asyncio.create_task(opening_of(within_s)._attach_late(twin_of(OnePath()), 1, task))
        while second.times == 9:  # noqa: ASYNC110
            await asyncio.sleep(0)
        attaching.cancel()
        await asyncio.wait({attaching})
        async with asyncio.timeout(20.0):
            while not second.closed:  # noqa: ASYNC110
                await asyncio.sleep(0.001)

    asyncio.run(story())
