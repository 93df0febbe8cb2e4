"""Polls a node that hangs on a bus at the robot, and records what it tells by this host's clock.

It sends that bus a SYNC of its own, as a master would, and writes the frames as a master's tap has them. So
the recording is one for `--node-recording`. Nothing else may poll that bus meanwhile.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import msgpack
from pydantic import Field

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.clock import NS_PER_S, monotonic_ns
from common.config.section import RelativePath, Section
from common.errors import TandemError
from common.process.pacing import TickGrid
from common.process.runtime import until_stopped
from common.process.ticker import ticks
from common.recording import McapRecorder
from common.wire.version import software
from deploy.experiments.prove.recorded import NodeRates
from master.journal.calls import FRAME, FRAMES, TICK, VERSION, Call
from master.suit.number import number_of
from master.suit.protocol import SHIPPED_DBC, SuitProtocol


class PollConfig(Section):
    """The file of `tandem prove --poll`: the bus at the robot."""

    bus: BusConfig
    rate_hz: int = Field(default=200, ge=50, le=1000)
    """SYNCs a second."""
    dbc: RelativePath = Path(SHIPPED_DBC)
    """The suit's messages."""


class FrameTape:
    """Puts all frames from one SYNC to the next as one message, as a master's tap does. Pure."""

    def __init__(self, put: Callable[[bytes, int], object]) -> None:
        """`put` takes a message and when its SYNC went out."""
        self._put = put
        self._calls: list[Call] = []
        self._since_ns = 0

    def tick(self, tick: int, now_ns: int) -> None:
        """A SYNC goes out now."""
        self.flush()
        self._since_ns = now_ns
        self._calls.append((TICK, tick, now_ns))

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """A frame came."""
        self._calls.append((FRAME, bus, frame_id, bytes(data), now_ns))

    def flush(self) -> None:
        """Put what came since the last SYNC."""
        if self._calls:
            self._put(msgpack.packb((VERSION, self._calls)), self._since_ns)
            self._calls.clear()


async def poll(
    config: PollConfig,
    node: int,
    out: Path,
    stop: asyncio.Event,
    show: Callable[[int], object],
) -> None:
    """Until `stop` is set; `show` is told each second how many SYNCs the node answered in it.

    Raises TandemError where the node never answered, or the disk failed; BusError where there is no bus.
    """
    protocol = SuitProtocol.load(config.dbc)
    rates = NodeRates(protocol, node)
    head = {"role": "poll", "host": "robot", "tandem": software().tandem}
    with McapRecorder(out, head) as recorder:

        def put(payload: bytes, at_ns: int) -> None:
            recorder.put(FRAMES, payload, at_ns)
            rates.take(payload)

        tape = FrameTape(put)
        bus = CanBus(config.bus, tape.frame)
        bus.open()
        try:
            await until_stopped(stop, _ask(bus, protocol, tape, config.rate_hz, rates, show))
        finally:
            await bus.close()
            tape.flush()
    if recorder.counters.failed:
        raise TandemError(f"{out}: {recorder.counters.failed}; make room and poll again")
    if not len(rates.speed().at_ns):
        raise TandemError(
            f"--node {node}: it answered no SYNC on bus {config.bus.name} ({config.bus.interface} "
            f"{config.bus.channel}); look at its number, its power and the bus's bit rates"
        )


async def _ask(
    bus: CanBus, protocol: SuitProtocol, tape: FrameTape, rate_hz: int, rates: NodeRates,
    show: Callable[[int], object],
) -> None:  # fmt: skip
    period_ns = round(NS_PER_S / rate_hz)
    since_ns = monotonic_ns()
    async for due in ticks(TickGrid(since_ns + period_ns, period_ns)):
        bus.read()
        now_ns = monotonic_ns()
        tape.tick(due.tick, now_ns)
        bus.send(protocol.sync(number_of(due.tick)))
        if now_ns - since_ns >= NS_PER_S:
            show(rates.answers_since(since_ns))
            since_ns = now_ns
