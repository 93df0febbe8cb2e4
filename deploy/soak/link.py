"""What the emulated network does by its nature, and what it lost in the last second."""

from __future__ import annotations

from typing import Any

from deploy.network import Network, Profile
from deploy.network.scheduler import OUTAGE
from deploy.soak.counts import Additions


def nature(profile: Profile) -> dict[str, Any]:
    """Percent of the packets to the robot that are lost, late, come twice; and how long one takes at most."""
    way = profile.ways.to_robot
    return {
        "name": profile.name,
        "lost": way.loss_percent,
        "late": way.reorder_percent,
        "repeated": way.duplicate_percent,
        "burst_packets": way.burst_packets or 1.0,
        "way_s": (way.delay_ms + 4.0 * way.jitter_ms) / 1e3,
    }


class LinkLosses:
    """Packets to the robot that the network dropped, second by second."""

    def __init__(self, network: Network | None) -> None:
        self._network = network
        self._added = Additions()

    def row(self) -> dict[str, float]:
        """`link_lost` by chance or for want of room, `link_out` as nothing passed; {} without a network."""
        if self._network is None:
            return {}
        dropped = self._network.counters().to_robot.dropped
        out = dropped.get(OUTAGE, 0)
        return {
            "link_lost": self._added.take("lost", sum(dropped.values()) - out),
            "link_out": self._added.take("out", out),
        }
