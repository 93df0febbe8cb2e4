"""Asks the nodes on real buses, for `conformance`."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from common.can.bus import CanBus
from common.clock import NS_PER_MS, monotonic_ns, to_ns, to_s
from common.errors import TandemError
from deploy.harness.host import HostWatch, watch_host
from deploy.ops.suit.conformance import PERIOD_NS, Conformance, RuleVerdict
from master.capture.source import with_layouts
from master.config import MasterConfig
from master.suit.protocol import SuitProtocol

_LEAST_S = 0.05
MOST_STALLED_NS = 3 * NS_PER_MS
"""A period in which this host was stalled for longer says nothing of the nodes, and is asked again."""
_TRIES = 20


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
        async with watch_host() as host:
            await _ask_all(test, buses, host)
    finally:
        for bus in buses:
            await bus.close()
    return test.verdicts()


async def _ask_all(test: Conformance, buses: Sequence[CanBus], host: HostWatch) -> None:
    """Ask, and ask again what fell into a stall of this host. Raises TandemError where stalls go on."""

    def stalled(began_ns: int, ended_ns: int) -> bool:
        late_ns = max(ended_ns - began_ns - PERIOD_NS, to_ns(host.stood_still_s(began_ns, ended_ns)))
        return late_ns > MOST_STALLED_NS

    steps = test.steps
    for _ in range(_TRIES):
        for step in steps:
            frame = test.begin(step, monotonic_ns())
            if frame is not None:
                for bus in buses:
                    bus.send(frame)
            await asyncio.sleep(to_s(PERIOD_NS))
            for bus in buses:
                bus.read()
        test.end(monotonic_ns())
        await host.known(monotonic_ns())
        steps = test.void(stalled)
        if not steps:
            return
    raise TandemError(
        f"this host was stalled for more than {1e-6 * MOST_STALLED_NS:g} ms in each of {_TRIES} rounds: "
        "nothing can be said of the nodes; end what else runs here, or use another host"
    )
