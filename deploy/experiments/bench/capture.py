"""What it costs to receive the suit: SYNC out, every node's answer in, on a bus between two processes."""

from __future__ import annotations

import asyncio
import resource

import uvloop

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.clock import monotonic_ns, to_ns
from common.errors import BusError
from common.process.heap import freeze_heap
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from deploy.experiments.bench.pipeline import BUS, LOST_AFTER, RATE_HZ, answers, nodes
from deploy.experiments.bench.worker import beside, in_worker
from deploy.harness.endpoints import free_port
from deploy.measure.timing import spread, spread_us
from master.suit.poll import Poll
from master.suit.protocol import SuitProtocol

START_S = 10.0
"""By then the suit's process is up."""
_WARM_UP_TICKS = 20
_CHUNK = 20
"""Ticks to one reading of the processor's time, which is counted in coarse steps on some systems."""
_WRAP = 64
"""Ticks are numbered anew after so many, so that as many prepared answers serve for ever."""


def capture(seconds: float, count: int, fd: bool) -> dict[str, object]:
    """µs of processor a tick to receive and decode `count` nodes, how long they take, ticks missed."""
    port = free_port("udp")
    with beside(suit, port=port, count=count, fd=fd):
        return in_worker(listen, seconds, port=port, count=count, fd=fd)


def suit(port: int, count: int, fd: bool) -> None:
    """Answer every SYNC with frames made beforehand, until killed."""
    protocol = SuitProtocol.load()
    prepared = [answers(protocol, count, tick, fd) for tick in range(_WRAP)]

    async def serve() -> None:
        def on_frame(_: str, frame_id: int, data: bytes, __: int) -> None:
            if frame_id == protocol.sync_id:
                for frame in prepared[protocol.parse_sync(data) % _WRAP]:
                    bus.send(frame)

        bus = CanBus(_config(port, fd), on_frame)
        bus.open()
        await asyncio.Event().wait()

    uvloop.run(serve())


def listen(seconds: float, port: int, count: int, fd: bool) -> dict[str, object]:
    """The master's side of it, without anything that comes after decoding."""
    return uvloop.run(_listen(seconds, port, count, fd))


class _Listener:
    """A master that goes no further than decoding."""

    def __init__(self, port: int, count: int, fd: bool) -> None:
        self._poll = Poll(nodes(count), SuitProtocol.load(), LOST_AFTER, {BUS: fd})
        self._open = False
        self.bus = CanBus(_config(port, fd), self._on_frame)
        self.answered_ns: list[int] = []
        """From SYNC to the last answer, of ticks that every node answered."""

    def tick(self, number: int) -> None:
        """Close the last tick where it still waits, and ask anew."""
        if self._open:
            self._close(monotonic_ns())
        self._open = True
        self.bus.send(self._poll.open_window(number % _WRAP, monotonic_ns()))

    def _on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self._poll.on_frame(bus, frame_id, data, now_ns) and self._open:
            self._close(now_ns)

    def _close(self, now_ns: int) -> None:
        self._open = False
        sweep = self._poll.close_window(now_ns)
        if sweep.fresh.all():
            self.answered_ns.append(sweep.frames_in_ns - sweep.sampled_ns)


async def _listen(seconds: float, port: int, count: int, fd: bool) -> dict[str, object]:
    listener = _Listener(port, count, fd)
    listener.bus.open()
    freeze_heap()
    period_ns = to_ns(1 / RATE_HZ)
    grid = TickGrid(monotonic_ns() + period_ns, period_ns)
    await _until_answered(listener, grid)
    listener.answered_ns.clear()
    ran = missed = 0
    chunks_us: list[float] = []
    begin_ns, before_s = grid.next_ns, _processor_s()
    async for due in ticks(grid):
        listener.tick(due.tick)
        ran += 1
        missed += due.missed
        if ran % _CHUNK == 0:
            after_s = _processor_s()
            chunks_us.append(1e6 * (after_s - before_s) / _CHUNK)
            before_s = after_s
        if due.scheduled_ns - begin_ns >= to_ns(seconds):
            break
    await listener.bus.close()
    return {
        "cpu_us": spread(chunks_us),
        "answers_us": spread_us(listener.answered_ns),
        "ticks": {"expected": ran + missed, "missed": missed},
        "answered_share": round(min(1.0, len(listener.answered_ns) / ran), 4),
    }


async def _until_answered(listener: _Listener, grid: TickGrid) -> None:
    """Tick until the suit is up and has answered a while. Raises BusError where it never does."""
    async for due in ticks(grid):
        listener.tick(due.tick)
        if len(listener.answered_ns) >= _WARM_UP_TICKS:
            return
        if due.tick > START_S * RATE_HZ:
            raise BusError(f"{BUS}: the nodes have not all answered within {START_S:g} s")


def _config(port: int, fd: bool) -> BusConfig:
    return BusConfig(
        name=BUS,
        interface="udp_multicast",
        channel="239.74.163.2",
        fd=fd,
        options={"port": port, "hop_limit": 0},
    )


def _processor_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
