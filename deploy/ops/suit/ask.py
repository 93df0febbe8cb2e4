"""Asks the nodes on real buses, for `conformance`."""

from __future__ import annotations

import asyncio

from common.can.bus import CanBus
from common.clock import monotonic_ns, to_s
from common.errors import TandemError
from deploy.ops.suit.conformance import PERIOD_NS, Conformance, RuleVerdict
from master.capture.source import with_layouts
from master.config import MasterConfig
from master.suit.protocol import SuitProtocol

_LEAST_S = 0.05


async def ask(config: MasterConfig) -> list[RuleVerdict]:
    """Test all nodes that speak tandem's own protocol. Raises BusError, and TandemError where none does."""
    nodes = {name: n for name, n in with_layouts(config.nodes, config.suit).items() if n.layout is None}
    if not nodes:
        raise TandemError("no node of this file speaks tandem's own protocol: there is nothing to test")
    fd = {bus.name: bus.fd for bus in config.capture.buses}
    test = Conformance(nodes, SuitProtocol.load(config.capture.dbc), fd)
    asked = {node.bus for node in nodes.values()}
    buses = [CanBus(bus, test.frame) for bus in config.capture.buses if bus.name in asked]
    try:
        for bus in buses:
            bus.open()
        await asyncio.sleep(_LEAST_S)
        for step in test.steps:
            frame = test.begin(step, monotonic_ns())
            if frame is not None:
                for bus in buses:
                    bus.send(frame)
            await asyncio.sleep(to_s(PERIOD_NS))
            for bus in buses:
                bus.read()
    finally:
        for bus in buses:
            await bus.close()
    return test.verdicts()
