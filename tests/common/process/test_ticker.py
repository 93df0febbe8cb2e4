import asyncio
import os
from collections.abc import Callable
from contextlib import aclosing
from pathlib import Path

import pytest
import uvloop

from common.clock import monotonic_ns
from common.process.pacing import DueTick, TickGrid
from common.process.ticker import ticks

PERIOD_NS = 2_000_000
LOOPS = {"asyncio": asyncio.new_event_loop, "uvloop": uvloop.new_event_loop}
either_loop = pytest.mark.parametrize("loop_factory", LOOPS.values(), ids=LOOPS)
LoopFactory = Callable[[], asyncio.AbstractEventLoop]


def timers() -> list[int]:
    """The open kernel timers of this process."""
    found = []
    for entry in Path("/proc/self/fd").iterdir():
        try:
            if str(entry.readlink()) == "anon_inode:[timerfd]":
                found.append(int(entry.name))
        except FileNotFoundError:  # the listing's own descriptor
            continue
    return sorted(found)


async def take(grid: TickGrid, count: int, busy_ns: int = 0) -> list[DueTick]:
    taken: list[DueTick] = []
    async with aclosing(ticks(grid)) as due_ticks:
        async for due in due_ticks:
            assert monotonic_ns() >= due.scheduled_ns
            taken.append(due)
            if len(taken) == count:
                break
            begun_ns = monotonic_ns()
            while monotonic_ns() - begun_ns < busy_ns:
                pass
    return taken


@either_loop
def test_ticks_come_on_the_grid_and_none_twice(loop_factory: LoopFactory) -> None:
    async def test() -> None:
        before = timers()
        origin_ns = monotonic_ns() + PERIOD_NS
        taken = await take(TickGrid(origin_ns, PERIOD_NS), 20)
        assert [d.scheduled_ns for d in taken] == [origin_ns + d.tick * PERIOD_NS for d in taken]
        assert taken[-1].tick + 1 == len(taken) + sum(d.missed for d in taken)
        assert timers() == before

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(test())


@either_loop
def test_a_caller_that_is_always_late_skips_and_lets_the_loop_live(loop_factory: LoopFactory) -> None:
    async def test() -> None:
        turns = 0

        async def other_work() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        work = asyncio.create_task(other_work())
        await asyncio.sleep(0)
        taken = await take(TickGrid(monotonic_ns(), PERIOD_NS), 5, busy_ns=5 * PERIOD_NS // 2)
        assert all(d.missed >= 1 for d in taken[1:])
        assert turns > len(taken)
        work.cancel()

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(test())


@either_loop
def test_a_cancelled_wait_closes_its_timer(loop_factory: LoopFactory) -> None:
    async def test() -> None:
        before = timers()
        never = TickGrid(monotonic_ns() + 3600 * 10**9, PERIOD_NS)
        task = asyncio.create_task(take(never, 1))
        await asyncio.sleep(0)
        assert len(timers()) == len(before) + 1
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert timers() == before

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(test())


def test_the_timer_never_blocks_and_is_not_inherited() -> None:
    async def test() -> None:
        before = timers()
        async with aclosing(ticks(TickGrid(monotonic_ns(), PERIOD_NS))) as due_ticks:
            await anext(due_ticks)
            for timer in set(timers()) - set(before):
                assert not os.get_blocking(timer)
                assert not os.get_inheritable(timer)

    asyncio.run(test())


def test_a_grid_that_began_long_ago_starts_at_once() -> None:
    async def test() -> None:
        first = (await take(TickGrid(0, PERIOD_NS), 1))[0]
        assert first.missed == first.tick > 0

    asyncio.run(test())
