"""What the emulated network does by its nature, and what it lost in the last second."""

from __future__ import annotations

from deploy.experiments.soak.counts import Additions
from deploy.experiments.soak.files.happenings import NetworkNature
from deploy.harness.link_settings import needed_age_s
from deploy.sim.network import Network, Profile
from deploy.sim.network.scheduler import OUTAGE


def nature(profile: Profile) -> NetworkNature:
    """Its name, how long a packet to the robot takes at most, but for queues, and the guard's age limit."""
    way = profile.ways.to_robot
    way_s = (way.delay_ms + 4.0 * way.jitter_ms) / 1e3
    return NetworkNature(profile.name, way_s, needed_age_s(profile))


class LinkLosses:
    """What the network did to packets to the robot, second by second."""

    def __init__(self, network: Network | None) -> None:
        self._network = network
        self._added = Additions()

    def row(self) -> dict[str, float]:
        """`link_lost`: by chance or want of room; `link_out`: nothing passed; `link_odd`: turned, doubled."""
        if self._network is None:
            return {}
        counters = self._network.counters().to_robot
        out = counters.dropped.get(OUTAGE, 0)
        totals = {
            "link_lost": sum(counters.dropped.values()) - out,
            "link_out": out,
            "link_odd": counters.reordered + counters.duplicated,
        }
        return {name: self._added.take(name, total) for name, total in totals.items()}
