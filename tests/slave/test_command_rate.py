"""The rate of commands that a robot asks for: up on evidence, down at once, and not up again too soon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.clock import NS_PER_MS, NS_PER_S, to_ns
from common.clock_sync import Offset
from common.wire.messages import Command, CommandStamps
from slave.command_rate import FIRST_WAIT_NS, USUAL_MS, WantedRate

KNOWN = Offset(-5 * NS_PER_S, NS_PER_MS, trusted=True)
"""The master's clock is 5 s behind."""
UNKNOWN = replace(KNOWN, trusted=False)
COMMAND = Command(
    "robot-1", 1, 0, 0, CommandStamps(0, 0, 0, 0), True, np.ones(1, np.bool_), np.zeros(1), np.zeros(1)
)


class Line:
    """A line to a robot that gets the rate it asks for."""

    def __init__(self, delay_ms: float = 0.5, offset: Offset = KNOWN) -> None:
        self.rate, self._offset = WantedRate(), offset
        self.delay_ms, self.jitter_ms, self.lost = delay_ms, 0.0, 0.0
        self._random = np.random.default_rng(3)
        self.sequence, self.now_ns = 0, 1000 * NS_PER_S
        self.came_ns = 0
        self.asked: list[int] = []

    def run(self, seconds: float) -> list[int]:
        """The periods that were asked for, one after the other."""
        begun, end_ns = len(self.asked), self.now_ns + to_ns(seconds)
        while self.now_ns < end_ns:
            self.now_ns += self.rate.period_ms * NS_PER_MS
            self.sequence += 1
            if self._random.random() < self.lost:
                continue
            put_ns = self._offset.remote_ns(self.now_ns)
            late_ms = self.delay_ms + abs(self._random.normal(0.0, self.jitter_ms))
            command = replace(
                COMMAND, sequence=self.sequence, stamps=CommandStamps(put_ns, put_ns, put_ns, put_ns)
            )
            # nothing overtakes
            self.came_ns = max(self.came_ns, self.now_ns + round(late_ms * NS_PER_MS))
            self.rate.note(command, self.came_ns, self._offset)
            if not self.asked or self.asked[-1] != self.rate.period_ms:
                self.asked.append(self.rate.period_ms)
        return self.asked[begun:]


def test_a_lan_is_asked_for_50_hz_once_it_has_proved_itself() -> None:
    line = Line()
    assert line.run(4.0) == [USUAL_MS]
    assert line.run(4.0) == [20]
    assert line.run(60.0) == []


@pytest.mark.parametrize(("delay_ms", "offset"), [(25.0, KNOWN), (300.0, KNOWN), (0.5, UNKNOWN)])
def test_a_longer_line_or_one_of_unknown_length_is_asked_for_25(delay_ms: float, offset: Offset) -> None:
    line = Line(delay_ms, offset)
    assert line.run(60.0) == [USUAL_MS, 40]


@pytest.mark.parametrize(("jitter_ms", "lost"), [(40.0, 0.0), (0.0, 0.12)])
def test_a_rough_line_is_asked_for_no_more_than_every_line(jitter_ms: float, lost: float) -> None:
    line = Line(25.0)
    line.jitter_ms, line.lost = jitter_ms, lost
    assert line.run(60.0) == [USUAL_MS]


@pytest.mark.parametrize(
    ("delay_ms", "jitter_ms", "lost", "why"), [(0.5, 60.0, 0.0, "jitter"), (25.0, 0.0, 0.15, "lost")]
)
def test_loss_or_jitter_brings_the_usual_rate_at_once_and_for_a_while(
    delay_ms: float, jitter_ms: float, lost: float, why: str
) -> None:
    line = Line(delay_ms)
    line.run(8.0)
    faster = line.rate.period_ms
    assert faster < USUAL_MS
    line.jitter_ms, line.lost = jitter_ms, lost
    assert line.run(2.5) == [USUAL_MS]
    assert line.rate.falls == 1
    assert why in line.rate.words
    assert "tried again in 10 s" in line.rate.words
    line.jitter_ms = line.lost = 0.0
    assert line.run(7.0) == []
    assert line.run(6.0) == [faster]


def test_each_fall_doubles_the_wait_until_a_rate_has_proved_itself() -> None:
    line, waits = Line(25.0), []
    line.run(8.0)
    for _ in range(3):
        line.lost = 0.3
        line.run(3.0)
        line.lost, fell_ns = 0.0, line.now_ns
        while line.rate.period_ms == USUAL_MS:
            line.run(0.5)
        waits.append((line.now_ns - fell_ns) / FIRST_WAIT_NS)
    assert waits == pytest.approx([1.0, 2.0, 4.0], abs=0.35)
    line.run(65.0)
    line.lost = 0.3
    line.run(3.0)
    assert "tried again in 10 s" in line.rate.words


def test_one_burst_of_two_is_no_reason() -> None:
    line = Line(25.0)
    line.run(8.0)
    line.sequence += 2
    assert line.run(20.0) == []
    assert line.rate.falls == 0


def test_another_lease_begins_at_the_usual_rate() -> None:
    line = Line()
    line.run(8.0)
    line.rate.begin()
    assert line.rate.period_ms == USUAL_MS
    line.sequence = 0
    assert line.run(4.0) == [USUAL_MS]


def test_a_clock_that_goes_back_begins_anew() -> None:
    line = Line()
    line.run(8.0)
    line.now_ns -= 3600 * NS_PER_S
    line.came_ns = 0
    line.run(0.2)
    assert line.rate.period_ms == USUAL_MS
