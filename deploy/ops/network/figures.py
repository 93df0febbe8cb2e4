"""What the link does, from what both ends noted, beside what its profile says. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import fmean, median, pstdev

from common.clock import NS_PER_MS
from common.errors import NetworkError
from deploy.sim.network.delay import MEMORY
from deploy.sim.network.loss import gilbert_elliott
from deploy.sim.network.profile import Way

DELAY_MS, LOSS_POINTS, RATE_SHARE = 1.0, 0.5, 0.03
"""How near the link must be to its profile: ms, points of loss, share of the rate."""
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
    planned_ms: float | None = None
    """Mean of what the emulation drew for these very packets; None where it does not tell."""
    planned_loss_percent: float | None = None
    """What the emulation drew to be lost, likewise."""
    rate_mbit: float | None = None
    """What came through when more was sent; None where that was not tried."""
    expected_rate_mbit: float | None = None

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
        """Within a millisecond of what was drawn, which is the profile's but for what chance may do.

        Where the emulation does not tell what it drew, the two are judged as one.
        """
        if self.planned_ms is None:
            return abs(self.delay_off_ms) <= DELAY_MS + self.delay_bound_ms
        # a tenth: queueing behind the packet before
        drawn = abs(self.planned_ms - self.expected_ms) <= self.delay_bound_ms + 0.1 * DELAY_MS
        return drawn and abs(self.mean_ms - self.planned_ms) <= DELAY_MS

    @property
    def loss_kept(self) -> bool:
        """Within half a point of what was drawn, which is the profile's but for what chance may do."""
        if self.planned_loss_percent is None:
            return abs(self.loss_off_percent) <= LOSS_POINTS + self.loss_bound_percent
        drawn = abs(self.planned_loss_percent - self.expected_loss_percent) <= self.loss_bound_percent + 1e-9
        return drawn and abs(self.loss_percent - self.planned_loss_percent) <= LOSS_POINTS

    @property
    def rate_kept(self) -> bool:
        """True where there is none, or it was not tried."""
        rate, expected = self.rate_mbit, self.expected_rate_mbit
        return rate is None or expected is None or abs(rate / expected - 1.0) <= RATE_SHARE

    @property
    def kept(self) -> bool:
        """All of it."""
        return self.delay_kept and self.loss_kept and self.rate_kept

    def tree(self) -> dict[str, object]:
        """For JSON."""
        offs = {"delay_off_ms": self.delay_off_ms, "loss_off_percent": self.loss_off_percent}
        kept = {"delay_kept": self.delay_kept, "loss_kept": self.loss_kept, "rate_kept": self.rate_kept}
        return {**asdict(self), **offs, **kept}


@dataclass(frozen=True, slots=True)
class Measured:
    """A network's two ways."""

    profile: str
    backend: str
    to_robot: WayMeasured
    to_operator: WayMeasured

    @property
    def kept(self) -> bool:
        """Whether both are as the profile says."""
        return self.to_robot.kept and self.to_operator.kept

    def tree(self) -> dict[str, object]:
        """For JSON."""
        ways = {"to_robot": self.to_robot.tree(), "to_operator": self.to_operator.tree()}
        return {"profile": self.profile, "backend": self.backend, "kept": self.kept, **ways}


def judge(
    way: Way,
    sent: int,
    arrivals: Sequence[Sequence[int]],
    size: int,
    seconds: float,
    planned_ms: float | None = None,
    planned_loss_percent: float | None = None,
) -> WayMeasured:
    """From what one end sent and the other noted: number, sent, received. NetworkError where that is none."""
    if not arrivals:
        raise NetworkError(f"none of {sent} packets came through the emulated link")
    delay_ms: list[float] = []
    seen: set[int] = set()
    newest, passed = -1, 0
    for number, sent_ns, received_ns in arrivals:
        if number not in seen:
            seen.add(number)
            delay_ms.append((received_ns - sent_ns) / NS_PER_MS)
            passed += number < newest
        newest = max(newest, number)
    loss = gilbert_elliott(way)
    serial_ms = 0.0 if way.rate_mbit is None else size * 8e-3 / way.rate_mbit
    # those held back for reordering are late by intent, and no part of what was planned in order
    held_ms = way.reorder_percent / 100.0 * way.reorder_ms
    return WayMeasured(
        sent=sent,
        received=len(seen),
        mean_ms=fmean(delay_ms),
        p50_ms=median(delay_ms),
        p99_ms=sorted(delay_ms)[math.ceil(0.99 * len(delay_ms)) - 1],
        jitter_ms=pstdev(delay_ms),
        loss_percent=100.0 * (1.0 - len(seen) / sent),
        reordered_percent=100.0 * passed / sent,
        duplicate_percent=100.0 * (len(arrivals) - len(seen)) / sent,
        expected_ms=way.delay_ms + serial_ms + held_ms,
        expected_loss_percent=way.loss_percent,
        delay_bound_ms=delay_bound_ms(way, seconds),
        loss_bound_percent=100.0 * loss.bound(sent, SIGMAS),
        planned_ms=None if planned_ms is None else planned_ms + held_ms,
        planned_loss_percent=planned_loss_percent,
    )


def rate_mbit(arrivals: Sequence[Sequence[int]], size: int) -> float:
    """What came through: bits of IP packets a second between the first arrival and the last."""
    times = [received_ns for _, _, received_ns in arrivals]
    return (len(times) - 1) * size * 8e3 / (max(times) - min(times))


def delay_bound_ms(way: Way, seconds: float) -> float:
    """The mean of a process with memory varies as that of seconds / (2 × memory) independent draws."""
    if not way.jitter_ms:
        return 0.0
    draws = max(seconds / (2.0 * MEMORY * way.jitter_ms / 1e3), 1.0)
    return float(SIGMAS * way.jitter_ms / math.sqrt(draws))
