"""Follows each accepted command from the master's sample to the encoder that moved. Pure.

What the figures can say, and what not:

- `moved` is the first change any encoder shows after the command was first written. While the robot is
  already moving that is hardly more than the wait for the next reading: it proves that the loop is closed,
  not how soon the robot answers. That is the motion lag, which is found by comparing whole motions.
- All rows are over the same commands: those that were accepted while the robot followed, and after which
  something moved before the next came. Commands that were lost, refused (the oldest are) or moved nothing are
  in no row, but in the guard's counters and in `unmoved`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.clock_sync import Offset
from common.latency.budget import LatencyBudget
from common.latency.stamps import Passage
from common.wire.messages import Command, CommandEcho
from slave.servos.servos import EncoderReading

MOVED_COUNTS = 2
"""An encoder has moved when it differs by this much: one count may be flicker (0.088° each)."""


@dataclass(frozen=True, slots=True)
class _Underway:
    command: Command
    received_ns: int
    accepted_ns: int
    offset: Offset
    written_ns: int = 0
    counts: NDArray[np.int64] | None = None
    """Encoder counts when it was written."""


class Journeys:
    """One command under way at a time: the newest. An older one that moved nothing is counted."""

    def __init__(self) -> None:
        self.budget = LatencyBudget()
        self.echo: CommandEcho | None = None
        self.unmoved = 0
        self._underway: _Underway | None = None

    def accepted(
        self, command: Command, received_ns: int, now_ns: int, offset: Offset, moving: bool = True
    ) -> None:
        """Begin to follow a command that has passed the gates.

        Where the robot is not `moving` it has no way to the servos, also if somebody engages right after: it
        is only echoed.
        """
        if self._underway is not None and self._underway.written_ns:
            self.unmoved += 1
        self._underway = _Underway(command, received_ns, now_ns, offset) if moving else None
        self.echo = CommandEcho(command.sequence, command.stamps.put_ns, received_ns, now_ns, 0)

    def forget(self) -> None:
        """Forget the old sender: the commands come from another operator, and so from another clock."""
        self.echo = self._underway = None

    def written(self, now_ns: int, counts: NDArray[np.int64]) -> None:
        """Note the first write after acceptance."""
        underway = self._underway
        if underway is None or underway.written_ns or self.echo is None:
            return
        self._underway = replace(underway, written_ns=now_ns, counts=counts.copy())
        self.echo = replace(self.echo, written_ns=now_ns)

    def read(self, reading: EncoderReading) -> None:
        """Close the journey at the first reading, later than the write, in which a joint has moved."""
        underway = self._underway
        if underway is None or underway.counts is None or reading.read_ns <= underway.written_ns:
            return
        turned = np.abs(reading.counts - underway.counts)
        turned = np.minimum(turned, 4096 - turned)
        if not (turned[reading.valid] >= MOVED_COUNTS).any():
            return
        self._underway = None
        stamps = underway.command.stamps
        self.budget.record(
            Passage(
                sampled_ns=stamps.sampled_ns,
                frames_in_ns=stamps.frames_in_ns,
                angles_ns=stamps.angles_ns,
                put_ns=stamps.put_ns,
                received_ns=underway.received_ns,
                accepted_ns=underway.accepted_ns,
                written_ns=underway.written_ns,
                moved_ns=reading.read_ns,
            ),
            underway.offset,
        )
