"""The deadman held on a page: only an operator's page that sees the present holds it, and one at a time."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from common.clock import monotonic_ns, to_ns
from common.inputs.heartbeat import decode_beat
from deploy.console.deadman import DeadmanRelay
from deploy.console.hub import BEAT_S, SEEN_S
from deploy.console.model.robot import TAP
from deploy.console.viewers import OpenPage
from tests.deploy.console.robots import state
from tests.deploy.console.served import NURSE, OpenedPage, Served, served


class HeardBeats(DeadmanRelay):
    """Keeps what would be told the master."""

    def __init__(self) -> None:
        super().__init__(Path("/nowhere"))
        self.told: list[bool] = []

    def beat(self, down: bool) -> None:
        self.told.append(down)


Story = Callable[[Served, HeardBeats], Awaitable[None]]


@pytest.fixture(autouse=True)
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """What left, left now: how old a view is does not depend on how fast this host is."""
    now_ns = monotonic_ns()
    for module in ("viewers", "hub"):
        monkeypatch.setattr(f"deploy.console.{module}.monotonic_ns", lambda: now_ns)


def run(story: Story, logged_in: bool = True) -> None:
    async def told() -> None:
        relay = HeardBeats()
        async with served() as console:
            console.hub.deadman = relay
            if logged_in:
                await console.log_in(NURSE)
            await story(console, relay)
        relay.close()

    asyncio.run(told())


async def seeing(console: Served) -> tuple[OpenedPage, OpenPage, int]:
    """A page that has just seen a view: both its ends, and the view's number."""
    page = await console.page()
    await page.hear("hello")
    robot = next(iter(console.models.values()))
    robot.on_state(state(at_s=monotonic_ns() / 1e9), monotonic_ns(), TAP)
    console.hub._show_view(robot, monotonic_ns())
    number = (await page.hear("view"))["n"]
    return page, console.hub.pages[-1], number


def test_a_page_holds_by_beats_that_quote_what_it_saw() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        page, own, number = await seeing(console)
        await page.say(kind="held", n=number, down=True)
        await page.say(kind="held", n=number, down=False)
        await page.say(kind="stop")
        await page.hear("answer")
        assert relay.told == [True, False]
        assert not own.holds

    run(story)


def test_a_stranger_does_not_hold() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        page, _, number = await seeing(console)
        await page.say(kind="held", n=number, down=True)
        assert "log in" in (await page.hear("answer"))["text"]
        assert relay.told == []

    run(story, logged_in=False)


@pytest.mark.parametrize("number", [None, 0, 99, "1", -1, 2, True])
def test_a_beat_that_quotes_nothing_that_left_does_not_hold(number: object) -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        _, own, seen = await seeing(console)
        assert seen == 1
        assert "old state" in console.hub.held(own, True, number)
        assert relay.told == []

    run(story)


def test_a_page_that_stands_still_does_not_hold_from_half_a_second_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        _, own, number = await seeing(console)
        left_ns = own.outbox.left_ns(number) or 0
        now_ns = [left_ns + to_ns(SEEN_S)]
        monkeypatch.setattr("deploy.console.viewers.monotonic_ns", lambda: now_ns[0])
        assert console.hub.held(own, True, number) == ""
        now_ns[0] += 1
        assert "old state" in console.hub.held(own, True, number)
        assert relay.told == [True]

    run(story)


def test_one_page_at_a_time_holds() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        _, first, number = await seeing(console)
        _, second, other = await seeing(console)
        number = first.outbox.number
        assert console.hub.held(first, True, number) == ""
        assert "another page" in console.hub.held(second, True, other)
        assert console.hub.held(first, False, number) == ""
        assert console.hub.held(second, True, other) == ""
        assert relay.told == [True, False, True]

    run(story)


def test_a_page_that_closes_releases() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        page, own, number = await seeing(console)
        assert console.hub.held(own, True, number) == ""
        await page.socket.close()
        while console.hub.pages:  # noqa: ASYNC110
            await asyncio.sleep(0)
        assert relay.told == [True, False]

    run(story)


def test_a_page_that_falls_silent_releases_and_must_let_go_before_it_holds_again() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        _, own, number = await seeing(console)
        assert console.hub.held(own, True, number) == ""
        console.hub._watch_deadman(own.beat_ns + to_ns(BEAT_S))
        assert relay.told == [True]
        console.hub._watch_deadman(own.beat_ns + to_ns(BEAT_S) + 1)
        assert relay.told == [True, False, False], "released, and told again as long as nobody holds"
        assert "release" in console.hub.held(own, True, number)
        console.hub.held(own, False, number)
        assert console.hub.held(own, True, number) == ""

    run(story)


def test_a_gap_counts_though_the_console_itself_stood_still(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        _, own, number = await seeing(console)
        assert console.hub.held(own, True, number) == ""
        now_ns = [own.beat_ns + to_ns(BEAT_S)]
        monkeypatch.setattr("deploy.console.hub.monotonic_ns", lambda: now_ns[0])
        assert console.hub.held(own, True, number) == ""
        now_ns[0] += to_ns(BEAT_S) + 1
        assert "release" in console.hub.held(own, True, number), "before anybody looked"
        assert relay.told == [True, True, False]

    run(story)


def test_a_page_that_was_lost_while_it_held_must_let_go_when_it_is_back() -> None:
    async def story(console: Served, relay: HeardBeats) -> None:
        page, own, number = await seeing(console)
        assert console.hub.held(own, True, number) == ""
        for _ in range(2):  # also where it was lost again before it let go
            await page.socket.close()
            while console.hub.pages:  # noqa: ASYNC110
                await asyncio.sleep(0)
            page, own, number = await seeing(console)
            assert "release" in console.hub.held(own, True, number)
        assert relay.told == [True, False]
        assert console.hub.held(own, False, number) == ""
        assert console.hub.held(own, True, number) == ""

    run(story)


def test_beats_are_numbered_and_one_that_nobody_takes_is_counted(tmp_path: Path) -> None:
    relay = DeadmanRelay(tmp_path / "none.sock")
    relay.beat(True)
    relay.beat(False)
    assert relay.failed == 2
    master = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    with master:
        master.bind(str(relay.path))
        relay.beat(True)
        relay.beat(False)
        beats = [decode_beat(master.recv(256)) for _ in range(2)]
    assert [(each.number, each.down) for each in beats] == [(3, True), (4, False)]
    relay.close()
