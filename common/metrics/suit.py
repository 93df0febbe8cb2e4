"""What the simulated suit writes when it stops."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.bus import BusMetrics
from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class SuitMetrics(Metrics):
    """The simulated suit's process."""

    syncs: int
    malformed_syncs: int
    ticks: int
    frames: int
    stale_syncs: int
    buses: dict[str, BusMetrics]
