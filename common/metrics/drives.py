"""What the simulated drives write when they stop."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.bus import BusMetrics
from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class DrivesMetrics(Metrics):
    """The simulated drives' process."""

    syncs: int
    faults: int
    stopped_by_themselves: int
    """Drives that lost the slave's heartbeat, or were taken out of operation, while enabled."""
    buses: dict[str, BusMetrics]
