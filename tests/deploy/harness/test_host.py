"""What the reference loops tell of the host."""

from __future__ import annotations

import asyncio
import json
import os

import pytest

from common.clock import NS_PER_MS, NS_PER_S, monotonic_ns
from common.metrics.parts import Ticks
from deploy.harness.host import HostWatch, watch_host
from deploy.harness.reference_loop import PERIOD_NS, stolen_ns


def told(*stalls: tuple[int, int, int]) -> HostWatch:
    """A host whose loops began at 1 s; `stalls` are of a core, from and until ms."""
    host = HostWatch()
    host.take(json.dumps({"cores": [0, 1], "origin_ns": NS_PER_S, "priority": True}))
    for core, from_ms, until_ms in stalls:
        span = {"from_ns": from_ms * NS_PER_MS, "until_ns": until_ms * NS_PER_MS}
        host.take(json.dumps({"core": core, "missed": (until_ms - from_ms) // 5, **span}))
    return host


@pytest.mark.parametrize(
    ("since_ms", "until_ms", "still_ms"),
    [
        (1000, 3000, 300),
        (1000, 2100, 100),
        (2250, 3000, 50),
        (2300, 3000, 0),
        (1300, 2000, 0),
        (1000, 1400, 40),
    ],
)
def test_the_longest_of_any_core_counts_as_far_as_it_lies_within(
    since_ms: int, until_ms: int, still_ms: int
) -> None:
    host = told((0, 1100, 1140), (1, 2000, 2300), (0, 1200, 1230))
    assert host.stood_still_s(since_ms * NS_PER_MS, until_ms * NS_PER_MS) == pytest.approx(still_ms / 1e3)


def test_figures_are_of_the_worst_core() -> None:
    figures = told((0, 1100, 1140), (1, 2000, 2300), (0, 1200, 1230)).metrics(3 * NS_PER_S)
    assert figures is not None
    assert figures.ticks == Ticks(2 * NS_PER_S // PERIOD_NS, 60)
    assert (figures.longest_ms, figures.priority) == (300.0, True)


@pytest.mark.parametrize(
    ("since_ms", "until_ms", "lost_ms"),
    [(1000, 3000, 370), (1120, 1210, 30), (2250, 3000, 50), (1300, 2000, 0)],
)
def test_time_lost_is_that_in_which_any_core_stood_still_counted_once(
    since_ms: int, until_ms: int, lost_ms: int
) -> None:
    host = told((0, 1100, 1140), (1, 2000, 2300), (0, 1200, 1230), (0, 2100, 2200), (1, 1110, 1130))
    assert host.lost(since_ms * NS_PER_MS, until_ms * NS_PER_MS).excused_s == pytest.approx(lost_ms / 1e3)


@pytest.mark.parametrize(
    ("at_ms", "explained"),
    [
        (1040, False),  # 40 ms until then
        (1050, True),
        (1499, True),
        (1510, False),  # 40 of the 50 ms lie within the last half second
        (3050, True),  # pieces, on different cores, that only together are enough
        (3049, False),
    ],
)
def test_a_hold_is_explained_by_what_was_lost_just_before(at_ms: int, explained: bool) -> None:
    host = told((0, 1000, 1050), (1, 2700, 2720), (0, 2710, 2730), (1, 3030, 3100))
    assert host.lost_before(at_ms * NS_PER_MS).explains_hold is explained


def test_a_loop_s_word_that_it_ticks_is_no_stall() -> None:
    host = told((0, 1100, 1140))
    host.take(json.dumps({"core": 1, "from_ns": 7, "until_ns": 8 * NS_PER_S, "missed": 0}))
    assert [stall.core for stall in host.stalls] == [0]
    assert host.known_ns == {0: 1140 * NS_PER_MS, 1: 8 * NS_PER_S}


def test_without_priority_only_what_was_stolen_excuses() -> None:
    host = HostWatch()
    host.take(json.dumps({"cores": [0], "origin_ns": NS_PER_S, "priority": False}))
    stall = {"core": 0, "from_ns": 2 * NS_PER_S, "until_ns": 3 * NS_PER_S, "missed": 200}
    host.take(json.dumps({**stall, "stolen_ns": 0}))
    host.end()
    assert not host.lost_before(3 * NS_PER_S).explains_hold
    assert asyncio.run(host.excuse(NS_PER_S)) == ""
    host.take(json.dumps({**stall, "stolen_ns": 50 * NS_PER_MS}))
    host.end()
    assert host.lost_before(3 * NS_PER_S).explains_hold
    assert asyncio.run(host.excuse(NS_PER_S)) == "the host stalled for 50 ms: /proc/stat shows steal"


def test_a_host_that_was_not_measured_excuses_nothing() -> None:
    assert HostWatch().metrics(NS_PER_S) is None
    assert HostWatch().stood_still_s(0, NS_PER_S) == 0.0
    assert not HostWatch().lost_before(NS_PER_S).explains_hold


@pytest.mark.parametrize(("core", "stolen_ms"), [(0, 120), (1, 0), (10, 70), (2, 0), (3, 0)])
def test_steal_is_read_by_core(core: int, stolen_ms: int) -> None:
    stat = (
        "cpu  9 9 9 9 9 9 9 99 0 0\ncpu0 1 2 3 4 5 6 7 12 8 9\ncpu1 1 2 3 4 5 6 7 0 8 9\ncpu3 1 2 3 4\n"
        "cpu10 1 2 3 4 5 6 7 7 8 9\nintr 5 0\n"
    )
    assert stolen_ns(stat, core, 100) == stolen_ms * NS_PER_MS


@pytest.mark.live
def test_real_loops_tick_on_every_core_and_end_with_the_block() -> None:
    async def story() -> HostWatch:
        async with watch_host() as host:
            assert host.began_ns
            await host.known(host.began_ns + 2 * PERIOD_NS)
            found = host.metrics(monotonic_ns())
            assert found is not None
            assert found.ticks.expected > 0
        return host

    host = asyncio.run(story())
    assert all(stall.priority is host.priority for stall in host.stalls)
    assert {stall.core for stall in host.stalls} <= os.sched_getaffinity(0)
    assert all(stall.until_ns - stall.from_ns >= PERIOD_NS and stall.missed > 0 for stall in host.stalls)
