"""The guard's times after commands over some line, without anything else of the guard."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from common.clock import NS_PER_MS
from common.clock_sync import Offset
from common.wire.messages import Command, CommandStamps
from slave.guard.config import GuardConfig
from slave.guard.times import LinkTimes

CAPTURED_MS = 10.0
"""From the sample to the put."""


class Line:
    """Sends commands to a guard's times; both clocks are one."""

    def __init__(self, config: GuardConfig | None = None) -> None:
        self.times = LinkTimes(config or GuardConfig())
        self.now_ms = 1_000.0
        self.sequence = 0

    def send(self, one_way_ms: float, gap_ms: float = 80.0, *, moving: bool = True) -> None:
        """The next arrives `gap_ms` after the one before; the offset's bound is the way, as usual."""
        self.now_ms += gap_ms
        self.sequence += 1
        put_ns = round((self.now_ms - one_way_ms) * NS_PER_MS)
        sampled_ns = put_ns - round(CAPTURED_MS * NS_PER_MS)
        command = Command(
            "robot-1", 1, self.sequence, 0, CommandStamps(sampled_ns, sampled_ns, sampled_ns, put_ns), True,
            np.ones(1, np.bool_), np.zeros(1), np.zeros(1),
        )  # fmt: skip
        offset = Offset(0, round(one_way_ms * NS_PER_MS), trusted=True)
        self.times.note(command, round(self.now_ms * NS_PER_MS), offset, moving=moving)

    def send_all(self, ways_ms: Iterable[float], *, moving: bool = True) -> None:
        """One every 80 ms."""
        for way_ms in ways_ms:
            self.send(way_ms, moving=moving)

    @property
    def age_ms(self) -> float:
        """In force."""
        return self.times.max_age_ns / NS_PER_MS

    @property
    def timeout_ms(self) -> float:
        """In force."""
        return self.times.command_timeout_ns / NS_PER_MS


def times_over(one_way_ms: float) -> LinkTimes:
    """After half a minute of a steady line, the robot standing."""
    line = Line()
    line.send_all([one_way_ms] * 375, moving=False)
    return line.times
