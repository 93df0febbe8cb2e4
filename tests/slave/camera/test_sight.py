from __future__ import annotations

from dataclasses import replace

import numpy as np

from common.clock_sync import Offset
from common.wire.messages import Command, CommandStamps
from slave.camera.sight import Sight

MS = 1_000_000
AHEAD = Offset(offset_ns=5000 * MS, bound_ns=2 * MS, trusted=True)
"""The master's clock is five seconds ahead."""


def command(seen_frame: int, seen_ms: int, sampled_ms: int) -> Command:
    zero, none = np.zeros(3), np.ones(3, np.bool_)
    stamps = CommandStamps(sampled_ms * MS, 0, 0, 0)
    return Command("r", 1, 1, 1, stamps, True, none, zero, zero, seen_frame, seen_ms * MS)


def test_the_age_of_what_the_operator_saw_is_taken_on_one_clock() -> None:
    sight = Sight()
    sight.sent(7, captured_ns=100 * MS, sent_ns=110 * MS)
    seen = sight.on_command(command(7, 5150, 5200), 300 * MS, AHEAD)
    assert sight.observation_age.summary().max == 100.0
    assert sight.transit.summary().max == 40.0
    assert seen is not None
    assert (seen.number, seen.known_ns, seen.delay_ns) == (7, 300 * MS, 38 * MS)


def test_every_command_has_an_age_but_a_picture_is_acknowledged_once() -> None:
    sight = Sight()
    sight.sent(7, 100 * MS, 110 * MS)
    assert sight.on_command(command(7, 5150, 5200), 300 * MS, AHEAD) is not None
    assert sight.on_command(command(7, 5150, 5280), 380 * MS, AHEAD) is None
    assert sight.observation_age.count == 2
    assert sight.transit.count == 1


def test_pictures_of_another_run_and_untrusted_clocks_measure_nothing() -> None:
    sight = Sight()
    sight.sent(7, 100 * MS, 110 * MS)
    assert sight.on_command(command(0, 0, 5200), 300 * MS, AHEAD) is None
    assert sight.on_command(command(999, 5150, 5200), 300 * MS, AHEAD) is None
    seen = sight.on_command(command(7, 5150, 5200), 300 * MS, Offset(0, 10**15, trusted=False))
    assert seen is not None
    assert seen.delay_ns is None
    assert sight.observation_age.count == 0


def test_only_the_newest_pictures_are_remembered() -> None:
    sight = Sight()
    for number in range(1, 1001):
        sight.sent(number, number, number)
    assert sight.on_command(command(700, 5150, 5200), 300 * MS, AHEAD) is None
    assert sight.on_command(command(1000, 5150, 5200), 300 * MS, AHEAD) is not None


def test_it_knows_when_the_newest_picture_was_taken_that_the_operator_has() -> None:
    sight = Sight()
    sight.sent(7, 100 * MS, 110 * MS)
    sight.sent(8, 200 * MS, 210 * MS)
    assert sight.captured_ns is None
    sight.on_command(command(0, 0, 5200), 300 * MS, AHEAD)
    assert sight.captured_ns is None, "none has come yet"
    sight.on_command(command(7, 5150, 5200), 300 * MS, AHEAD)
    sight.on_command(command(8, 5250, 5280), 380 * MS, AHEAD)
    assert sight.captured_ns == 200 * MS
    sight.on_command(command(99, 5250, 5280), 400 * MS, AHEAD)
    assert sight.captured_ns == 200 * MS, "a picture that nobody remembers is no newer one"
    sight.on_command(replace(command(0, 0, 5400), lease=2), 500 * MS, AHEAD)
    assert sight.captured_ns is None, "another operator, who has none"
