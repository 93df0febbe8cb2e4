"""The list of robots over real sessions, directly and through a router; what nobody hears is known."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from common.clock import monotonic_ns
from common.link import LinkSession, open_session, presence
from common.link.config import LinkConfig
from common.link.roster import Roster
from common.wire.summary import RobotSummary, encode_summary
from common.wire.topics import STATE, SUMMARY
from tests.common.link.test_link import free_endpoint, run, until


@asynccontextmanager
async def two_sides(routed: bool) -> AsyncIterator[tuple[LinkConfig, LinkSession]]:
    """Where a robot connects, and a session that watches."""
    door = free_endpoint()
    if not routed:
        async with open_session(LinkConfig(listen=[door])) as watching:
            yield LinkConfig(connect=[door]), watching
        return
    client = LinkConfig(mode="client", connect=[door])
    async with open_session(LinkConfig(listen=[door]), mode="router"), open_session(client) as watching:
        yield client, watching


def summary(sequence: int) -> bytes:
    return encode_summary(RobotSummary("a", 7, sequence, "hold", "waits", wanted_by="anna"))


@pytest.mark.parametrize("routed", [False, True])
def test_a_robot_and_an_operator_appear_and_vanish(routed: bool) -> None:
    async def test() -> None:
        roster = Roster()
        async with two_sides(routed) as (door, watching):
            watching.watch_roster(roster)
            async with open_session(door) as at_home:
                link = at_home.link("a")
                put = link.publish(SUMMARY)
                link.declare_alive("slave", 7, ["tcp/10.0.0.1:1"], "nursing")
                at_home.declare_operator("anna", [])
                await until(lambda: "a" in roster and "anna" in roster.operators)
                listed = roster.robots()[0]
                assert listed.processes[7].profile == "nursing"
                sequence = 0
                while listed.fresh(monotonic_ns()) is None:
                    sequence += 1
                    put(summary(sequence))
                    await asyncio.sleep(0.05)
                at_home.drop("a")
                await until(lambda: "a" not in roster)
                assert "anna" in roster.operators
            await until(lambda: "anna" not in roster.operators)

    run(test)


@pytest.mark.parametrize("routed", [False, True])
def test_a_publisher_learns_whether_somebody_looks(routed: bool) -> None:
    async def test() -> None:
        wanted: list[bool] = []
        async with two_sides(routed) as (door, watching), open_session(door) as at_home:
            link = at_home.link("a")
            link.publish(STATE, wanted.append)
            assert wanted == [False]
            watching.link("a").subscribe(STATE, lambda *_: None)
            await until(lambda: wanted[-1])
            watching.drop("a")
            await until(lambda: not wanted[-1])
            watching.link("a").subscribe(STATE, lambda *_: None)
            await until(lambda: wanted[-1])

    run(test)


def test_a_host_that_shows_tokens_without_end_fills_no_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(presence, "MOST_OF_ALL", 10)

    async def test() -> None:
        shown: list[tuple[str, bool]] = []
        door = free_endpoint()
        async with open_session(LinkConfig(listen=[door])) as watching:
            watching.watch_presence(lambda one, here: shown.append((one.robot, here)))
            async with open_session(LinkConfig(connect=[door])) as flooding:
                for number in range(40):
                    flooding.link(f"r{number}").declare_alive("slave", 7)
                await until(lambda: len(shown) >= 10)
                flooding.link("last").declare_alive("slave", 7)
                flooding.drop("r0")
                await until(lambda: ("r0", False) in shown)
                assert sum(here for _, here in shown) == 10
                flooding.link("next").declare_alive("slave", 7)
                await until(lambda: ("next", True) in shown)
            await until(lambda: sum(here for _, here in shown) == sum(not here for _, here in shown))

    run(test)
