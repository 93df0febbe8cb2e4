"""Times several doors in turn, each at the rate of the commands, between two processes and on one clock.

Each time is half a round trip. At low rates most of it is the waking of an idle core: only the ratios
describe the code.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import AsyncExitStack

import uvloop

from common.clock import monotonic_ns, to_ns
from common.errors import LinkError
from common.link.zenoh_log import hear_refusals
from common.process.heap import freeze_heap
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.codec import encode
from common.wire.topics import COMMAND
from deploy.experiments.bench.doors import Door, SendPing, open_echo, open_ping
from deploy.experiments.bench.pipeline import example_command
from deploy.experiments.bench.worker import beside, in_worker
from deploy.measure.timing import Figures, spread_us

TIMEOUT_S = 0.5
CONNECT_S = 10.0
WARM_UP = 3
"""Rounds of each door that are not counted."""

OneWay = dict[str, Figures]
"""µs one way, by door."""


def one_way_us(doors: Mapping[str, Door], seconds: float) -> OneWay:
    """Time the doors between two processes of their own."""
    with beside(_echo_all, doors=dict(doors)):
        return in_worker(_ping_all, seconds, doors=dict(doors))


def ratio(figures: OneWay, above: str, below: str, of: str = "median") -> float | None:
    """One door's figure over another's; None where either is missing."""
    one, other = figures[above].get(of), figures[below].get(of)
    return round(one / other, 3) if one is not None and other else None


def _ping_all(seconds: float, doors: dict[str, Door]) -> OneWay:
    async def run() -> OneWay:
        async with AsyncExitStack() as stack:
            stagger = Stagger()
            for name, door in doors.items():
                stagger.doors[name] = await stack.enter_async_context(open_ping(door, stagger.on_echo))
            return await stagger.measure(seconds)

    _hear_refusals(doors, messages=False)  # as the services do, of which only the robot has a door
    return uvloop.run(run())


def _echo_all(doors: dict[str, Door]) -> None:
    async def run() -> None:
        async with AsyncExitStack() as stack:
            for door in doors.values():
                await stack.enter_async_context(open_echo(door))
            await asyncio.Event().wait()

    _hear_refusals(doors, messages=True)
    uvloop.run(run())


def _hear_refusals(doors: Mapping[str, Door], *, messages: bool) -> None:
    if any(door.keys is not None for door in doors.values()):
        hear_refusals(messages=messages)


class Stagger:
    """Takes the time of several doors in one run: each in turn, each at the rate of the commands."""

    def __init__(self) -> None:
        self.doors: dict[str, SendPing] = {}
        self._payload = encode(example_command())
        self._arrived: asyncio.Future[int] | None = None

    def on_echo(self, arrived_ns: int) -> None:
        """What was sent last is back."""
        if self._arrived is not None and not self._arrived.done():
            self._arrived.set_result(arrived_ns)

    async def measure(self, seconds: float) -> OneWay:
        """µs one way by door: half of each round trip. Raises LinkError for a door that gives no echo."""
        await self._until_all_answer()
        freeze_heap()
        names = list(self.doors)
        trips: dict[str, list[float]] = {name: [] for name in names}
        step_ns = to_ns(1.0 / (COMMAND.rate_hz * len(names)))
        begin_ns = monotonic_ns() + step_ns
        async for due in ticks(TickGrid(begin_ns, step_ns)):
            if due.scheduled_ns - begin_ns >= to_ns(seconds):
                break
            name = names[due.tick % len(names)]
            trip_ns = await self._round_trip_ns(self.doors[name])
            # an echo that never came took at least so long: left out, a link that loses would be the faster
            trips[name].append((to_ns(TIMEOUT_S) if trip_ns is None else trip_ns) / 2)
        return {name: spread_us(halves[WARM_UP:]) for name, halves in trips.items()}

    async def _round_trip_ns(self, send: SendPing) -> int | None:
        self._arrived = asyncio.get_running_loop().create_future()
        put_ns = monotonic_ns()
        send(self._payload)
        try:
            return await asyncio.wait_for(self._arrived, TIMEOUT_S) - put_ns
        except TimeoutError:
            return None

    async def _until_all_answer(self) -> None:
        deadline_ns = monotonic_ns() + to_ns(CONNECT_S)
        for name, send in self.doors.items():
            while await self._round_trip_ns(send) is None:
                if monotonic_ns() > deadline_ns:
                    raise LinkError(f"{name}: no echo within {CONNECT_S:g} s")
