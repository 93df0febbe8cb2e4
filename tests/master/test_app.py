"""The master's loop with a pipeline and robots that are not there, on ticks that are given."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from common.can.frame import CanFrame
from common.config.load import load_config
from common.process.notify import Notifier
from common.process.pacing import DueTick, TickGrid
from common.wire.topics import Topic
from master import app
from master.config import MasterConfig

EXAMPLE = Path(__file__).parents[2] / "deploy" / "examples" / "master.toml"


class FakeLink:
    def publish(self, _: Topic) -> Any:
        return lambda payload: None

    def subscribe(self, *_: object, **__: object) -> None: ...

    def subscribe_keys(self, *_: object, **__: object) -> None: ...

    def watch_presence(self, *_: object) -> None: ...

    def counters(self) -> dict[str, dict[str, int]]:
        return {}


class FakeSession:
    paths = ""
    overheard = None

    def link(self, _: str) -> FakeLink:
        return FakeLink()


class Counting(Notifier):
    def __init__(self) -> None:
        super().__init__()
        self.beats = 0
        self.said: list[str] = []

    def beat(self, now_ns: int) -> None:
        self.beats += 1

    def status(self, text: str) -> None:
        self.said.append(text)


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> tuple[app.Master, Counting]:
    async def some_ticks(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(1, 6):
            yield DueTick(tick, grid.origin_ns, 0)

    monkeypatch.setattr(app, "ticks", some_ticks)
    session: Any = FakeSession()
    notifier = Counting()
    return app.Master(load_config(EXAMPLE, MasterConfig), session, notifier), notifier


def test_the_watchdog_is_fed_by_each_tick_of_the_capture_loop(master: tuple[app.Master, Counting]) -> None:
    running, notifier = master
    asyncio.run(running._capture())
    assert notifier.beats == 5


def test_a_capture_loop_that_hangs_does_not_feed_it(
    master: tuple[app.Master, Counting], monkeypatch: pytest.MonkeyPatch
) -> None:
    running, notifier = master

    def hang(*_: object) -> None:
        raise TimeoutError  # so that the test can go on

    monkeypatch.setattr(running._pipeline, "tick", hang)
    with pytest.raises(TimeoutError):
        asyncio.run(running._capture())
    assert notifier.beats == 0


def test_what_is_told_beside_it_is_words_and_no_sign_of_life(master: tuple[app.Master, Counting]) -> None:
    running, notifier = master
    asyncio.run(running._publish_metrics())
    assert set(notifier.said) == {"robot-1: not heard"}
    assert notifier.beats == 0


def test_a_suit_of_which_no_node_is_asked_gives_its_snapshots_too(
    master: tuple[app.Master, Counting], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its windows close with the tick that opens them: no last frame ends them."""
    running, _ = master
    rests: list[int] = []

    class Tap:
        def rest(self, now_ns: int) -> None:
            rests.append(now_ns)

    monkeypatch.setattr(running, "_tap", Tap())
    monkeypatch.setattr(running, "_send", lambda _: None)
    monkeypatch.setattr(running._calls, "tick", lambda *_: (CanFrame(0x80, b"", fd=False), object()))
    asyncio.run(running._capture())
    assert len(rests) == 5
