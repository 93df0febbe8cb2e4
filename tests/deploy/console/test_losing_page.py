"""Where it is configured so, the robot is stopped when the page that engaged it is lost; else never."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from common.clock import monotonic_ns, to_ns
from deploy.console.hub import Hub
from deploy.console.model.robot import TAP
from deploy.console.viewers import LOST_S, OpenPage
from tests.deploy.console.robots import ROBOT, state
from tests.deploy.console.served import OpenedPage, Served, served

Story = Callable[[Served], Awaitable[None]]
MS = to_ns(0.001)


def run(story: Story, stops: bool = True) -> None:
    async def told() -> None:
        async with served() as console:
            console.hub.losing_page_stops = stops
            await console.log_in()
            await story(console)

    asyncio.run(told())


async def engaging(console: Served, guard: str = "track") -> tuple[OpenedPage, OpenPage]:
    """A page that has engaged the robot."""
    page = await console.page()
    await page.hear("hello")
    own = console.hub.pages[-1]
    console.hub.engaged[ROBOT] = own.secret
    console.models[ROBOT].on_state(state(at_s=monotonic_ns() / 1e9, guard=guard), monotonic_ns(), TAP)
    return page, own


async def leave(console: Served, page: OpenedPage) -> None:
    await page.socket.close()
    while console.hub.pages:  # noqa: ASYNC110
        await asyncio.sleep(0)


def watch_for(hub: Hub, seconds: float, from_ns: int) -> None:
    hub._watch_pages(from_ns)
    hub._watch_pages(from_ns + to_ns(seconds))


def test_the_loss_of_the_page_stops_the_robot_after_two_seconds_and_once() -> None:
    async def story(console: Served) -> None:
        page, _ = await engaging(console)
        await leave(console, page)
        now_ns = monotonic_ns()
        watch_for(console.hub, LOST_S, now_ns)
        assert console.stops[ROBOT].by == []
        console.hub._watch_pages(now_ns + to_ns(LOST_S) + 1)
        console.hub._watch_pages(now_ns + to_ns(10.0))
        assert console.stops[ROBOT].by == ["the page that engaged the robot was lost"]

    run(story)


def test_a_page_that_comes_back_in_time_stops_nothing() -> None:
    async def story(console: Served) -> None:
        page, _ = await engaging(console)
        await leave(console, page)
        now_ns = monotonic_ns()
        console.hub._watch_pages(now_ns)
        await (await console.page()).hear("hello")
        console.hub._watch_pages(now_ns + to_ns(1.9))
        console.hub._watch_pages(now_ns + to_ns(10.0))
        assert console.stops[ROBOT].by == []

    run(story)


def test_a_page_that_acknowledges_nothing_is_lost_too() -> None:
    async def story(console: Served) -> None:
        _, own = await engaging(console)
        own.outbox.offer("view", str)
        own.outbox.take(monotonic_ns())
        left_ns = own.outbox.owes_since_ns() or 0
        watch_for(console.hub, LOST_S, left_ns)
        assert console.stops[ROBOT].by == []
        console.hub._watch_pages(left_ns + to_ns(LOST_S) + 1)
        watch_for(console.hub, LOST_S + 0.001, left_ns + to_ns(LOST_S) + 1)
        assert len(console.stops[ROBOT].by) == 1

    run(story)


@pytest.mark.parametrize(("stops", "guard"), [(False, "track"), (True, "hold"), (True, "estop")])
def test_nothing_is_stopped_unless_it_is_configured_and_the_robot_is_engaged(stops: bool, guard: str) -> None:
    async def story(console: Served) -> None:
        page, _ = await engaging(console, guard)
        await leave(console, page)
        watch_for(console.hub, LOST_S + 1.0, monotonic_ns())
        assert console.stops[ROBOT].by == []

    run(story, stops)
