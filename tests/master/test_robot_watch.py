"""Silence of the robot on the master's own clock, and round trips closed by echoes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.clock import NS_PER_MS, to_ns
from common.metrics.parts import Summary
from common.wire.messages import CommandEcho, RobotState
from common.wire.topics import STATE
from master.robot_watch import RobotWatch

TIMEOUT_NS = to_ns(STATE.timeout_s)
SLAVE_AHEAD_NS = 10**15


def state(sent_ns: int = 0, echo: CommandEcho | None = None) -> RobotState:
    zeros = np.zeros(25)
    return RobotState("r", 1, sent_ns, 1, "hold", "", "", np.ones(25, np.bool_), zeros, zeros, echo, 0, 1)


def test_silence_begins_after_the_time_out_whatever_is_stamped() -> None:
    watch = RobotWatch()
    watch.on_state(state(sent_ns=SLAVE_AHEAD_NS), 1000)
    assert not watch.silent(1000 + TIMEOUT_NS)
    assert watch.silent(1001 + TIMEOUT_NS)


def test_states_that_never_came_are_counted_by_their_numbers() -> None:
    watch = RobotWatch()
    for instance, sequence in ((1, 40), (1, 41), (1, 2242), (2, 1), (2, 2), (2, 4), (2, 3)):
        watch.on_state(replace(state(), instance=instance, sequence=sequence), 0)
    assert watch.arrivals.lost == 2200


def test_people_are_told_once_a_change() -> None:
    watch = RobotWatch()
    assert watch.change(0) is None
    watch.on_state(state(), 0)
    assert watch.change(1) == "the robot is heard"
    assert watch.change(2) is None
    told = watch.change(TIMEOUT_NS + 1)
    assert told is not None
    assert "silent" in told
    assert watch.change(TIMEOUT_NS + 2) is None
    assert watch.times_lost == 1


def test_a_round_trip_excludes_the_slave_s_time_and_needs_no_clock() -> None:
    watch = RobotWatch()
    received_ns = SLAVE_AHEAD_NS + 3 * NS_PER_MS
    echo = CommandEcho(5, 1 * NS_PER_MS, received_ns, received_ns, received_ns)
    held_ns = 11 * NS_PER_MS
    watch.on_state(state(received_ns + held_ns, echo), 1 * NS_PER_MS + held_ns + 4 * NS_PER_MS)
    assert watch.round_trip.summary().mean == pytest.approx(4.0)
    # the same echo again, later, is the same command
    watch.on_state(state(received_ns + 2 * held_ns, echo), 10**12)
    assert watch.round_trip.summary().count == 1


def test_the_echo_of_another_masters_command_closes_no_round_trip() -> None:
    watch = RobotWatch()
    echo = CommandEcho(5, 10**14, SLAVE_AHEAD_NS, SLAVE_AHEAD_NS, SLAVE_AHEAD_NS)
    watch.on_state(state(SLAVE_AHEAD_NS, echo), 10**15, ours=False)
    assert watch.round_trip.summary() == Summary(0)
    watch.on_state(state(SLAVE_AHEAD_NS, echo), 10**14 + NS_PER_MS)
    assert watch.round_trip.summary().count == 1
