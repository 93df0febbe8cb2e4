"""The simulated drives on real buses: the only file here that knows of the event loop."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from types import MappingProxyType

import can

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.frame import CanFrame
from common.can.without_echo import open_without_function_code
from common.clock import NS_PER_S, monotonic_ns
from common.metrics.drives import DrivesMetrics
from common.process.heap import freeze_heap
from common.process.pacing import TickGrid
from common.process.realtime import enter_real_time
from common.process.runtime import until_stopped
from common.process.ticker import ticks
from deploy.sim.drives.faults import PlannedDriveFault
from deploy.sim.drives.makers import Maker
from deploy.sim.drives.peer import DrivePeer
from slave.config import SlaveConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.pdo import TPDO1
from slave.servos.mujoco.simulated import CYCLE_NS

log = logging.getLogger(__name__)

_OLDEST_S = 1.0
"""A message that seems older has a stamp of another clock."""


def _open(config: BusConfig) -> can.BusABC:
    return open_without_function_code(config, TPDO1)


def arrived_ns(message: can.Message) -> int:
    """When the kernel took a message in, monotonic ns: drives read angles then, however busy this host is."""
    age_s = time.time() - message.timestamp
    return monotonic_ns() - (round(age_s * NS_PER_S) if 0.0 < age_s < _OLDEST_S else 0)


async def run(
    config: SlaveConfig,
    stop: asyncio.Event,
    faults: Sequence[PlannedDriveFault] = (),
    makers: Mapping[str, Maker] = MappingProxyType({}),
) -> DrivesMetrics:
    """Be the drives that a slave's file names, until `stop` is set; returns what was counted.

    `makers`: joints whose drives another maker has built.

    Raises BusError where a bus cannot be opened.
    """
    canopen = config.servos.section(CanopenConfig)
    share = config.servos.share(CanopenConfig, config.skeleton, config.encoders)
    buses: dict[str, CanBus] = {}

    def send(bus: str, frame_id: int, data: bytes) -> None:
        if bus in buses:
            buses[bus].send(CanFrame(frame_id, data, False))

    peer = DrivePeer(canopen, share.skeleton, share.encoders, send, monotonic_ns(), faults)
    for joint, maker in makers.items():
        peer.build(joint, maker)
    logging.getLogger("canopen").setLevel(logging.WARNING)  # a line for each transfer else
    enter_real_time(config.process.realtime_priority)

    async def move() -> None:
        async for _ in ticks(TickGrid(monotonic_ns(), CYCLE_NS)):
            peer.advance(monotonic_ns())

    try:
        for bus in canopen.buses:
            buses[bus.name] = CanBus(
                bus, peer.on_frame, opener=_open, on_remote=peer.on_remote, arrived=arrived_ns
            )
            buses[bus.name].open()
        freeze_heap()
        where = ", ".join(f"{bus.name} ({bus.interface} {bus.channel})" for bus in canopen.buses)
        log.info("%d drives on %s", len(peer.drives), where)
        await until_stopped(stop, move())
    finally:
        await asyncio.gather(*(bus.close() for bus in buses.values()))
    return DrivesMetrics(**asdict(peer.counters), buses={name: bus.metrics() for name, bus in buses.items()})
