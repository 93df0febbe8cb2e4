"""What is counted of each node and each bus."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Counts: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class NodeHealth:
    """One node since the start. Every window is fresh, late or lost; the others count frames."""

    fresh: int
    """Windows it answered soundly."""
    late: int
    """Windows it missed while not (yet) lost."""
    lost: int
    """Windows in which it was lost."""
    times_lost: int
    bad_checksum: int
    bad_tick: int
    """Sound frames that answered another tick: too late, or from a node that counts wrongly."""
    bad_length: int
    duplicates: int
    """Sound frames beyond the first of a window; the first stands."""
    faults: int
    """Windows in which it said that its sensor is faulty: it counts as missed."""
    saturated: int
    """Windows in which it said that a reading is at the end of its range; the readings are used."""
    held: int = 0
    """Of a free-running node: ticks without a sample after their instant; the last one was held over."""
    missing: int = 0
    """Samples that never came, by its own count or time, or by its rate."""
    incomplete: int = 0
    """Samples of which a frame was missing."""
    resets: int = 0
    """How often its own time or count began anew."""
    overtaken: int = 0
    """Samples that came after a newer one, and were left out."""
    rate_changes: int = 0
    """How often it went on at another rate than before."""


@dataclass(slots=True)
class BusHealth:
    """What arrived on one bus and belongs to no node."""

    unknown_id: int = 0
    foreign_sync: int = 0
    """SYNCs that this master did not send."""
    overflow: int = 0
    """Frames dropped because more arrived in one window than any sound bus can carry."""


class NodeCounters:
    """The counters of `NodeHealth` for N nodes at once, each (N,)."""

    def __init__(self, count: int) -> None:
        self.fresh: Counts = np.zeros(count, dtype=np.int64)
        self.late: Counts = np.zeros(count, dtype=np.int64)
        self.lost: Counts = np.zeros(count, dtype=np.int64)
        self.times_lost: Counts = np.zeros(count, dtype=np.int64)
        self.bad_checksum: Counts = np.zeros(count, dtype=np.int64)
        self.bad_tick: Counts = np.zeros(count, dtype=np.int64)
        self.bad_length: Counts = np.zeros(count, dtype=np.int64)
        self.duplicates: Counts = np.zeros(count, dtype=np.int64)
        self.faults: Counts = np.zeros(count, dtype=np.int64)
        self.saturated: Counts = np.zeros(count, dtype=np.int64)
        self.held: Counts = np.zeros(count, dtype=np.int64)
        self.missing: Counts = np.zeros(count, dtype=np.int64)
        self.incomplete: Counts = np.zeros(count, dtype=np.int64)
        self.resets: Counts = np.zeros(count, dtype=np.int64)
        self.overtaken: Counts = np.zeros(count, dtype=np.int64)
        self.rate_changes: Counts = np.zeros(count, dtype=np.int64)

    def node(self, index: int) -> NodeHealth:
        """The counters of one node."""
        return NodeHealth(**{f.name: int(getattr(self, f.name)[index]) for f in fields(NodeHealth)})

    def totals(self) -> dict[str, int]:
        """The sum of each counter over all nodes."""
        return {f.name: int(getattr(self, f.name).sum()) for f in fields(NodeHealth)}
