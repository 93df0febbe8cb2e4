"""One way over tandem's link beside what lies under it, and over each transport."""

from __future__ import annotations

import tempfile
from pathlib import Path

from common.link.endpoint import SECURE, TRANSPORTS
from deploy.experiments.bench.doors import ROBOT, Door
from deploy.experiments.bench.round_trips import one_way_us, ratio
from deploy.harness.endpoints import free_ports, local_endpoints
from deploy.harness.keys import make_keys

BARE = "bare zenoh"
"""Zenoh over tcp without tandem's link, with the same configuration."""


def link(seconds: float) -> dict[str, object]:
    """µs one way through tandem's link, bare Zenoh and a bare UDP socket, and the ratios of the medians."""
    tandem, bare = (f"tcp/127.0.0.1:{port}" for port in free_ports("tcp", 2))
    [udp] = free_ports("udp", 1)
    doors = {
        "tandem": Door("link", tandem),
        "zenoh": Door("zenoh", bare),
        "udp": Door("udp", f"udp/127.0.0.1:{udp}"),
    }
    measured = one_way_us(doors, seconds)
    return {
        "one_way_us": measured,
        "over_bare_zenoh": ratio(measured, "tandem", "zenoh"),
        "over_bare_udp": ratio(measured, "tandem", "udp"),
        "bare_zenoh_over_bare_udp": ratio(measured, "zenoh", "udp"),
    }


def transports(seconds: float) -> dict[str, object]:
    """µs one way by transport beside bare Zenoh; medians over tcp's; tcp over bare Zenoh."""
    with tempfile.TemporaryDirectory(prefix="tandem-bench-") as name:
        folder = Path(name)
        ends = {BARE: local_endpoints("tcp", folder).robots[0]}
        for transport in TRANSPORTS:
            (folder / transport).mkdir()
            ends[transport] = local_endpoints(transport, folder / transport).robots[0]
        keys = make_keys(folder, ends.values(), [ROBOT])
        doors = {BARE: Door("zenoh", ends.pop(BARE))}
        for transport, end in ends.items():
            doors[transport] = Door("link", end, keys if transport in SECURE else None)
        measured = one_way_us(doors, seconds)
    over_tcp = {transport: ratio(measured, transport, "tcp") for transport in TRANSPORTS}
    secure = [over_tcp[transport] for transport in SECURE]
    return {
        "one_way_us": measured,
        "over_tcp": over_tcp,
        "worst_secure_over_tcp": max((each for each in secure if each is not None), default=None),
        "tcp_over_bare_zenoh": ratio(measured, "tcp", BARE),
        "tcp_p99_over_bare_zenoh": ratio(measured, "tcp", BARE, of="p99"),
    }
