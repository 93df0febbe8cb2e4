"""Where the time of a command went, stage by stage, with means that add up. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

from hdrh.histogram import HdrHistogram

from common.clock import NS_PER_MS
from common.metrics.published import Summary

if TYPE_CHECKING:  # a histogram needs none of the messages that it comes with
    from common.clock_sync import Offset

STAGES = (
    "sampled→frames in",
    "frames in→solved",
    "solved→put",
    "put→received",
    "received→accepted",
    "accepted→written",
    "written→moved",
)
"""Between neighbouring stamps of a Passage. Only `put→received` crosses from one clock to the other."""
_LONGEST_US = 60_000_000
_DIGITS = 3
MOST_STEPS = 128
MOST_RECENT = 256
"""Statistics tell what came in a second: a dozen, and more only where a link lets go what it held back."""


class Durations:
    """A histogram of durations, 1 µs to 60 s to three digits, beside their exact sum."""

    def __init__(self) -> None:
        self._histogram = HdrHistogram(1, _LONGEST_US, _DIGITS)
        self._sum_ns = 0
        self._max_ns = 0
        self.count = 0
        self.clamped = 0
        """Durations below zero, taken as zero."""

    def record(self, duration_ns: int) -> None:
        """Take one duration."""
        if duration_ns < 0:
            self.clamped += 1
            duration_ns = 0
        self._take(duration_ns, 1)

    def record_missing(self, longest_ns: int, interval_ns: int, count: int) -> None:
        """Take `count` durations, the longest first and each `interval_ns` shorter than the one before.

        So HdrHistogram's `record_corrected_value` fills in what was due while nothing came. Many are taken in
        at most MOST_STEPS values of as many each: the servo loop must not wait for an hour's worth.
        """
        each = -(-count // MOST_STEPS)
        for first in range(0, count, each):
            many = min(each, count - first)
            value_ns = longest_ns - first * interval_ns - (many - 1) * interval_ns // 2
            self._take(max(0, value_ns), many)
        self._max_ns = max(self._max_ns, longest_ns)

    def _take(self, duration_ns: int, count: int) -> None:
        self.count += count
        self._sum_ns += count * duration_ns
        self._max_ns = max(self._max_ns, duration_ns)
        self._histogram.record_value(min(round(duration_ns / 1000), _LONGEST_US), count)

    def merge(self, other: Durations) -> None:
        """Take all that another has taken."""
        self._histogram.add(other._histogram)
        self._sum_ns += other._sum_ns
        self._max_ns = max(self._max_ns, other._max_ns)
        self.count += other.count
        self.clamped += other.clamped

    def summary(self) -> Summary:
        """Mean and maximum exact, percentiles to three digits."""
        if not self.count:
            return Summary(0)
        return Summary(
            count=self.count,
            mean=self._sum_ns / self.count / NS_PER_MS,
            p50=self._histogram.get_value_at_percentile(50) / 1000,
            p99=self._histogram.get_value_at_percentile(99) / 1000,
            max=self._max_ns / NS_PER_MS,
        )


class Told(Durations):
    """Durations that are also told one by one, so that who listens can judge a stretch of time of its own."""

    def __init__(self) -> None:
        super().__init__()
        self._recent_us: deque[int] = deque(maxlen=MOST_RECENT)

    def _take(self, duration_ns: int, count: int) -> None:
        super()._take(duration_ns, count)
        self._recent_us.extend([round(duration_ns / 1000)] * min(count, MOST_RECENT))

    def take_recent(self) -> tuple[int, ...]:
        """Those since the last call in µs, the newest MOST_RECENT of them."""
        recent_us = tuple(self._recent_us)
        self._recent_us.clear()
        return recent_us


class RoundTrip(Told):
    """Time out and back on one host's clock, without the time the other side held it."""


class StageTimes:
    """Consecutive stages, recorded together, so that all rows are over the same commands."""

    def __init__(self, *stages: str) -> None:
        self._stages = {name: Durations() for name in stages}
        self._total = Durations()

    def record(self, *durations_ns: int) -> None:
        """Take one command's durations, in the order of the stages. ValueError if it is not one a stage."""
        if len(durations_ns) != len(self._stages):
            raise ValueError(f"{len(durations_ns)} durations for {len(self._stages)} stages")
        for stage, duration_ns in zip(self._stages.values(), durations_ns, strict=True):
            stage.record(duration_ns)
        self._total.record(sum(max(d, 0) for d in durations_ns))

    def merge(self, other: StageTimes) -> None:
        """Take all that another, of the same stages, has taken."""
        if list(other._stages) != list(self._stages):
            raise ValueError("different stages")
        for name, stage in self._stages.items():
            stage.merge(other._stages[name])
        self._total.merge(other._total)

    def summary(self) -> dict[str, Summary]:
        """A row a stage, in order, in ms; their means add up to that of `total`."""
        return {name: stage.summary() for name, stage in self._stages.items()}

    def total(self) -> Summary:
        """The whole, from the first stamp to the last."""
        return self._total.summary()


@dataclass(frozen=True, slots=True)
class Passage:
    """One command's stamps, from the operator's posture to the encoder that followed."""

    sampled_ns: int
    """Master's clock, as the next three."""
    frames_in_ns: int
    solved_ns: int
    put_ns: int
    """Right before the command is encoded, since it is in the command: `put→received` holds the encoding."""
    received_ns: int
    """Slave's clock, as the next three. In the link's thread, before the loop wakes."""
    accepted_ns: int
    """The loop took it up, and the gates then let it pass: to judge it is part of `accepted→written`."""
    written_ns: int
    """The first setpoint after that was handed to the servos."""
    moved_ns: int
    """The first encoder reading after that which differs; a robot that moves already differs at once."""


class LatencyBudget:
    """The stages of commands that went the whole way, recorded on the slave.

    The others, refused, lost or followed by no motion, are in no row.
    """

    def __init__(self) -> None:
        self._stages = StageTimes(*STAGES)
        self._bound_ns = 0
        self.untrusted = 0
        """Passages left out because the offset was not trusted."""
        self.early = 0
        """Passages received, by the measured offset, before they were put: the offset was off by that."""

    def record(self, passage: Passage, offset: Offset) -> None:
        """Take one passage. `offset` is the master's clock minus the slave's.

        All stamps are brought onto the master's clock. An offset that is off can put a stamp before the
        one it follows; it is then moved up to it and the next stage is the shorter, so that the rows still
        add up to the whole.
        """
        if not offset.trusted:
            self.untrusted += 1
            return
        p = passage
        on_slave = (p.received_ns, p.accepted_ns, p.written_ns, p.moved_ns)
        stamps = [p.sampled_ns, p.frames_in_ns, p.solved_ns, p.put_ns, *map(offset.remote_ns, on_slave)]
        if stamps[4] < p.put_ns:
            self.early += 1
        for i in range(1, len(stamps)):
            stamps[i] = max(stamps[i], stamps[i - 1])
        self._stages.record(*(after - before for before, after in pairwise(stamps)))
        self._bound_ns = max(self._bound_ns, offset.bound_ns)

    def merge(self, other: LatencyBudget) -> None:
        """Take all that another has taken."""
        self._stages.merge(other._stages)
        self._bound_ns = max(self._bound_ns, other._bound_ns)
        self.untrusted += other.untrusted
        self.early += other.early

    def summary(self) -> dict[str, Summary]:
        """A row a stage in ms; `put→received` also has `bound`, the widest its offset had."""
        rows = self._stages.summary()
        crossing = rows["put→received"]
        if crossing.count:
            rows["put→received"] = replace(crossing, bound=self._bound_ns / NS_PER_MS)
        return rows

    def total(self) -> Summary:
        """From sampled to moved; its mean is the sum of the stages' means."""
        return self._stages.total()
