"""The simulated suit on real buses: the only file here that knows of the event loop."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import can

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.without_echo import open_without_longer_than
from common.clock import to_s
from common.metrics.suit import SuitMetrics
from common.process.realtime import enter_real_time
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import Outgoing
from deploy.sim.suit.peer import NewestSync, PublishTruth, SuitPeer
from deploy.sim.suit.suit import SimulatedSuit, build_suit
from master.suit.protocol import SuitProtocol

log = logging.getLogger(__name__)


async def run(
    config: SuitConfig,
    stop: asyncio.Event,
    publish_truth: PublishTruth | None = None,
    on_suit: Callable[[SimulatedSuit], None] = lambda _: None,
) -> SuitMetrics:
    """Answer every SYNC until `stop` is set; returns what was counted.

    `publish_truth` is called once a tick, after the answers have gone out; `on_suit` once, with the suit
    that will answer. Raises ConfigError before anything is opened, and BusError where a bus cannot be.
    """
    protocol = SuitProtocol.load(config.dbc)
    suit = build_suit(config, protocol)
    on_suit(suit)
    enter_real_time(config.process.realtime_priority)
    loop = asyncio.get_running_loop()

    def send(outgoing: Outgoing) -> None:
        bus = buses[outgoing.bus]
        if outgoing.delay_ns:
            loop.call_later(to_s(outgoing.delay_ns), bus.send, outgoing.frame)
        else:
            bus.send(outgoing.frame)

    def opener(bus: BusConfig) -> can.BusABC:
        # its own answers, which it need not hear, are longer than a SYNC
        return open_without_longer_than(bus, protocol.sync(0))

    peer = SuitPeer(suit, protocol, send, publish_truth)
    newest = NewestSync(protocol.sync_id, peer.on_frame, loop.call_soon)
    buses = {bus.name: CanBus(bus, newest.on_frame, opener=opener) for bus in config.buses}
    try:
        for bus in buses.values():
            bus.open()
        opened = ", ".join(f"{bus.name} ({bus.interface} {bus.channel})" for bus in config.buses)
        log.info("simulated suit: answering every SYNC for %d nodes on %s", len(config.nodes), opened)
        await stop.wait()
    finally:
        await asyncio.gather(*(bus.close() for bus in buses.values()))
    counted = peer.counters
    return SuitMetrics(
        syncs=counted.syncs,
        malformed_syncs=counted.malformed_syncs,
        ticks=counted.ticks,
        frames=counted.frames,
        stale_syncs=newest.stale,
        buses={name: bus.metrics() for name, bus in buses.items()},
    )
