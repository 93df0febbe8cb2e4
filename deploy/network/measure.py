"""What the link does, measured from both ends, beside what its profile says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from common.clock import NS_PER_MS
from common.errors import NetworkError
from deploy.network.loss import gilbert_elliott
from deploy.network.profile import Way

RATE_HZ = 200.0
SMALL = 128
"""Bytes of an IP packet: about a command's."""
START_S = 1.0
"""Until both ends run."""
GRACE_S = 30.0
DELAY_MS, LOSS_POINTS = 1.0, 0.5
"""How near the link must be to its profile."""
SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class WayMeasured:
    """One direction; delays in ms, the rest in percent of the packets sent."""

    sent: int
    received: int
    mean_ms: float
    p50_ms: float
    p99_ms: float
    jitter_ms: float
    """Standard deviation."""
    loss_percent: float
    reordered_percent: float
    """Arrived after one that was sent later."""
    duplicate_percent: float
    expected_ms: float
    """The profile's delay, and the packet's own time on a link of its rate."""
    expected_loss_percent: float
    delay_bound_ms: float
    """How far the mean of so long a measurement may be off by chance, three sigma."""
    loss_bound_percent: float
    rate_mbit: float | None = None
    """What came through when more was sent; None where that was not tried."""

    @property
    def delay_off_ms(self) -> float:
        """From the profile."""
        return self.mean_ms - self.expected_ms

    @property
    def loss_off_percent(self) -> float:
        """From the profile, in points."""
        return self.loss_percent - self.expected_loss_percent

    @property
    def delay_kept(self) -> bool:
        """Within a millisecond, but for what chance may do."""
        return abs(self.delay_off_ms) <= DELAY_MS + self.delay_bound_ms

    @property
    def loss_kept(self) -> bool:
        """Within half a point, but for what chance may do."""
        return abs(self.loss_off_percent) <= LOSS_POINTS + self.loss_bound_percent

    def tree(self) -> dict[str, Any]:
        """For JSON."""
        offs = {"delay_off_ms": self.delay_off_ms, "loss_off_percent": self.loss_off_percent}
        return {**asdict(self), **offs, "delay_kept": self.delay_kept, "loss_kept": self.loss_kept}


def judge(way: Way, sent: int, arrivals: Sequence[Sequence[int]], size: int, seconds: float) -> WayMeasured:
    """From what one end sent and the other noted: number, sent, received. NetworkError where that is none."""
    if not arrivals:
        raise NetworkError(f"none of {sent} packets came through the emulated link")
    table = np.array(arrivals, np.int64)
    number, first = np.unique(table[:, 0], return_index=True)
    delay_ms = (table[first, 2] - table[first, 1]) / NS_PER_MS
    in_order = np.maximum.accumulate(table[:, 0]) <= table[:, 0]
    loss = gilbert_elliott(way)
    serial_ms = 0.0 if way.rate_mbit is None else size * 8e-3 / way.rate_mbit
    # those held back for reordering are late by intent
    held_ms = way.reorder_percent / 100.0 * way.reorder_ms
    return WayMeasured(
        sent=sent,
        received=len(number),
        mean_ms=float(delay_ms.mean()),
        p50_ms=float(np.percentile(delay_ms, 50)),
        p99_ms=float(np.percentile(delay_ms, 99)),
        jitter_ms=float(delay_ms.std()),
        loss_percent=100.0 * (1.0 - len(number) / sent),
        reordered_percent=100.0 * float((~in_order[first]).sum()) / sent,
        duplicate_percent=100.0 * (len(table) - len(number)) / sent,
        expected_ms=way.delay_ms + serial_ms + held_ms,
        expected_loss_percent=way.loss_percent,
        delay_bound_ms=delay_bound_ms(way, seconds),
        loss_bound_percent=100.0 * loss.bound(sent, SIGMAS),
    )


def delay_bound_ms(way: Way, seconds: float) -> float:
    """The mean of a process with memory varies as that of seconds / (2 × memory) independent draws."""
    if not way.jitter_ms:
        return 0.0
    from deploy.network.delay import MEMORY

    draws = max(seconds / (2.0 * MEMORY * way.jitter_ms / 1e3), 1.0)
    return float(SIGMAS * way.jitter_ms / math.sqrt(draws))
