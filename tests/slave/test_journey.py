"""A command's way from the master's sample to the encoder that moved."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.clock_sync import NEVER_MEASURED, Offset
from common.wire.messages import Command, CommandStamps
from slave.journey import MOVED_COUNTS, Journeys
from slave.servos.servos import EncoderReading

AHEAD_NS = 5_000 * NS_PER_MS
"""The slave's clock before the master's."""
OFFSET = Offset(-AHEAD_NS, 100_000, True)
STILL = np.array([10, 4095, 2000])


def at(ms: float) -> int:
    """Slave's clock."""
    return AHEAD_NS + round(ms * NS_PER_MS)


def command(sequence: int = 1) -> Command:
    stamps = CommandStamps(0, 1 * NS_PER_MS, 2 * NS_PER_MS, 3 * NS_PER_MS)
    return Command("r", 1, sequence, 16, stamps, True, np.ones(3, np.bool_), np.zeros(3), np.zeros(3))


def reading(ms: float, counts: np.ndarray, valid: tuple[bool, ...] = (True, True, True)) -> EncoderReading:
    return EncoderReading(at(ms), counts, np.array(valid))


def written(offset: Offset = OFFSET) -> Journeys:
    journeys = Journeys()
    journeys.accepted(command(), at(5), at(6), offset)
    journeys.written(at(8), STILL)
    return journeys


def test_every_stage_is_the_time_between_two_stamps() -> None:
    journeys = written()
    journeys.read(reading(12, STILL + [0, 0, MOVED_COUNTS]))
    rows = {name: row.mean for name, row in journeys.budget.summary().items()}
    assert list(rows.values()) == pytest.approx([1, 1, 1, 2, 1, 2, 4])
    assert journeys.budget.total().mean == pytest.approx(12)


@pytest.mark.parametrize(
    ("counts", "moved"),
    [
        (STILL, False),
        (STILL + [MOVED_COUNTS - 1, 0, 0], False),
        (STILL - [MOVED_COUNTS, 0, 0], True),
        (np.array([10, 0, 2000]), False),
        (np.array([10, 1, 2000]), True),
    ],
    ids=["still", "one count flickers", "two counts back", "one over the wrap", "two over the wrap"],
)
def test_what_counts_as_moved(counts: np.ndarray, moved: bool) -> None:
    journeys = written()
    journeys.read(reading(12, counts))
    assert journeys.budget.total().count == moved


def test_a_reading_from_before_the_write_shows_nothing() -> None:
    journeys = written()
    journeys.read(reading(8, STILL + 100))
    assert journeys.budget.total().count == 0


def test_an_encoder_that_cannot_be_trusted_has_not_moved() -> None:
    journeys = written()
    journeys.read(reading(12, STILL + [0, 0, 100], (True, True, False)))
    assert journeys.budget.total().count == 0


def test_each_command_is_recorded_once() -> None:
    journeys = written()
    journeys.read(reading(12, STILL + 100))
    journeys.read(reading(17, STILL + 200))
    assert journeys.budget.total().count == 1


def test_a_command_that_moved_nothing_is_counted_when_the_next_comes() -> None:
    journeys = written()
    journeys.accepted(command(2), at(85), at(86), OFFSET)
    assert journeys.unmoved == 1
    assert journeys.budget.total().count == 0


def test_a_command_accepted_in_hold_is_echoed_but_not_followed() -> None:
    journeys = Journeys()
    journeys.accepted(command(), at(5), at(6), OFFSET, moving=False)
    # engaged meanwhile: what is written now is not of that command
    journeys.written(at(70), STILL)
    journeys.read(reading(75, STILL + 100))
    assert journeys.budget.total().count == 0
    assert journeys.echo is not None
    assert journeys.echo.written_ns == 0


def test_the_echo_carries_the_newest_commands_stamps() -> None:
    journeys = Journeys()
    assert journeys.echo is None
    journeys.accepted(command(9), at(5), at(6), OFFSET)
    journeys.written(at(8), STILL)
    journeys.written(at(13), STILL)
    assert journeys.echo is not None
    echo = journeys.echo
    assert (echo.sequence, echo.put_ns) == (9, 3 * NS_PER_MS)
    assert (echo.received_ns, echo.accepted_ns, echo.written_ns) == (at(5), at(6), at(8))


def test_without_a_trusted_offset_nothing_is_called_latency() -> None:
    journeys = written(NEVER_MEASURED)
    journeys.read(reading(12, STILL + 100))
    assert journeys.budget.total().count == 0
