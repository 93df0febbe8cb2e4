"""Commands that were due and did not come, by time, those that were never sent included. Pure.

Sequence numbers alone do not show them. Where master and slave stall together, no command is put, none is
lost, and each that does come is as fast as ever: the seconds in between are in no percentile (coordinated
omission). Here every command that was due enters the corrected figures, as HdrHistogram's
`record_corrected_value` would have it, with how long the robot went without what that command had to say.
"""

from __future__ import annotations

import statistics
from collections import deque

from common.latency.durations import Durations, StreamedDurations
from common.metrics.slave import DueMetrics
from common.wire.topics import COMMAND

PERIODS = 15
"""Commands whose median interval is the period: a master may be set to another rate than usual."""
EARLY = 0.25
"""A command that comes this share of a period before the next is due makes that one not missing."""


class DueCommands:
    """Follows the commands of one master after the other; another master's first begins anew."""

    def __init__(self) -> None:
        self.corrected = Durations()
        """One way, of every command that came and of every one that was due and did not."""
        self.recent = StreamedDurations()
        """Durations of the commands that did not come, to be published one by one."""
        self.missing = 0
        """Was not there when it was due and a newer came; one that comes later yet stays counted."""
        self.came = 0
        self._clock: int | None = None
        self._put_ns = self._sequence = 0
        self._transit_ns = 0
        self._periods_ns: deque[int] = deque(maxlen=PERIODS)
        self._said_ns = 0

    def note(self, clock: int, sequence: int, put_ns: int, transit_ns: int | None, said_ns: int = 0) -> None:
        """Take one command.

        `clock` is the number of the master's clock, which outlasts a lease: a master that stalled has to
        claim the robot anew. `transit_ns`: put to received; None while the offset is not trusted. `said_ns`:
        the period that the command says; 0: none, and it is measured.
        """
        self.came += 1
        if transit_ns is not None:
            self._transit_ns = transit_ns
            self.corrected.record(transit_ns)
        if clock != self._clock:
            self._clock = clock
            self._periods_ns.clear()
            self._said_ns = said_ns
        elif sequence <= self._sequence or put_ns <= self._put_ns:
            return
        else:
            self._gap(put_ns - self._put_ns, sequence - self._sequence, said_ns)
        self._put_ns, self._sequence = put_ns, sequence

    def forget(self) -> None:
        """The master gave the robot back: until it claims it again nothing is due."""
        self._clock = None

    def _gap(self, gap_ns: int, numbers: int, said_ns: int) -> None:
        # where the rate changes, the slower one may still hold
        period_ns = max(said_ns, self._said_ns) or self.period_ns
        self._said_ns = said_ns
        missing = int(gap_ns / period_ns + EARLY) - 1
        if missing > 0:
            self.missing += missing
            longest_ns = max(0, self._transit_ns) + gap_ns - period_ns
            self.corrected.record_missing(longest_ns, period_ns, missing)
            self.recent.record_missing(longest_ns, period_ns, missing)
        self._periods_ns.append(gap_ns // numbers)

    @property
    def period_ns(self) -> int:
        """Between two commands, as this master says, or sends them."""
        if self._said_ns:
            return self._said_ns
        return (
            round(statistics.median(self._periods_ns)) if self._periods_ns else round(1e9 / COMMAND.rate_hz)
        )

    def metrics(self) -> DueMetrics:
        """The counts so far."""
        return DueMetrics(expected=self.came + self.missing, missing=self.missing)
