"""What the watch makes of messages; the link is a table of callbacks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.clock import NS_PER_MS, NS_PER_S
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary, Ticks
from common.metrics.slave import ArrivalCounts, DueMetrics, SlaveMetrics
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import Command, CommandEcho, CommandStamps, RobotState, Statistics
from deploy.experiments.soak.files.happenings import GuardChanged, Happening, JointsUnknown
from deploy.experiments.soak.motion import MotionWatch
from deploy.experiments.soak.watch import FRESH_NS, Watch
from tests.published import commanded, guard_metrics, master_metrics, slave_metrics

SKELETON = load_skeleton("nursing")
JOINTS = len(SKELETON.joints)
ALL, ZERO = np.ones(JOINTS, np.bool_), np.zeros(JOINTS)
COMMAND = Command("robot-1", 7, 5, 80, CommandStamps(1, 2, 3, 4), True, ALL, ZERO, ZERO)
MASTER_AHEAD_NS = 3600 * NS_PER_S
STATE = RobotState(
    "robot-1", 1, NS_PER_S, NS_PER_S, "track", "follows", "nurse-1", ALL, ZERO, ZERO, None, MASTER_AHEAD_NS,
    50_000,
)  # fmt: skip


class Heard:
    """A watch, its events, and messages to it at times of the own clock."""

    def __init__(self) -> None:
        self.events: list[Happening] = []
        self.watch = Watch(SKELETON, self.events.append)

    def state(self, arrived_ns: int = 0, **changes: Any) -> None:
        self.watch.on_state(encode(replace(STATE, **changes)), arrived_ns)

    def statistics(self, metrics: MasterMetrics | SlaveMetrics) -> None:
        self.watch.on_statistics(encode(Statistics(0, metrics)), 0)


@pytest.fixture
def heard() -> Heard:
    return Heard()


def echo(sequence: int, put_ns: int, way_ns: int) -> CommandEcho:
    """A command that left at a time of the slave's clock."""
    received_ns = put_ns + way_ns
    return CommandEcho(sequence, put_ns + MASTER_AHEAD_NS, received_ns, received_ns + NS_PER_MS, 0)


def test_each_command_s_way_is_counted_once_and_by_the_offset(heard: Heard) -> None:
    for sequence, way_ms in ((1, 2), (1, 2), (2, 4), (3, 9)):
        heard.state(echo=echo(sequence, sequence * NS_PER_S, way_ms * NS_PER_MS))
    row = heard.watch.row()
    assert (row["one_way_n"], row["one_way_p50_ms"], row["one_way_max_ms"]) == (3.0, 4.0, 9.0)
    assert row["age_max_ms"] == 10.0
    assert heard.watch.row()["one_way_n"] == 0.0


def test_the_way_to_the_servo_is_counted_once_it_is_written(heard: Heard) -> None:
    accepted = echo(1, NS_PER_S, 2 * NS_PER_MS)
    written = replace(accepted, written_ns=NS_PER_S + 5 * NS_PER_MS)
    heard.state(echo=accepted)
    assert "written_p50_ms" not in heard.watch.row()
    for _ in range(2):
        heard.state(echo=written)
    row = heard.watch.row()
    assert (row["written_p50_ms"], row["one_way_n"]) == (5.0, 0.0)


def test_an_offset_that_is_not_trusted_measures_nothing(heard: Heard) -> None:
    heard.state(echo=echo(1, NS_PER_S, NS_PER_MS), offset_bound_ns=-1)
    assert heard.watch.row()["one_way_n"] == 0.0


def test_commands_flow_while_new_ones_are_told_of(heard: Heard) -> None:
    watch = heard.watch
    heard.state(1_000, echo=echo(1, NS_PER_S, 0))
    assert watch.flows(1_000)
    assert not watch.flows(1_000, since_ns=1_000)
    heard.state(FRESH_NS, sequence=2, echo=echo(1, NS_PER_S, 0))
    assert watch.flows(FRESH_NS + 999)
    assert not watch.flows(FRESH_NS + 1_000)
    heard.state(FRESH_NS + 1_000, sequence=3, echo=echo(2, NS_PER_S, 0))
    assert watch.flows(FRESH_NS + 1_000, since_ns=1_000)


def test_a_robot_that_is_silent_is_said_to_be(heard: Heard) -> None:
    assert heard.watch.guard(0) == "silent"
    heard.state(0)
    assert heard.watch.guard(NS_PER_S // 10) == "track"
    assert heard.watch.guard(NS_PER_S) == "silent"


def test_guard_changes_are_reported_once_and_missed_states_counted(heard: Heard) -> None:
    for sequence, guard in ((1, "track"), (2, "track"), (5, "hold"), (6, "hold"), (7, "align")):
        heard.state(sequence, sequence=sequence, guard=guard)
    changes = [(e.from_, e.to) for e in heard.events if isinstance(e, GuardChanged)]
    assert changes == [("", "track"), ("track", "hold"), ("hold", "align")]
    assert heard.watch.held_ns == 5
    assert heard.watch.row()["states_missed"] == 2.0


def test_joints_that_are_not_known_are_told(heard: Heard) -> None:
    for valid in (ALL, ALL, ~ALL, ALL):
        heard.watch.on_command(encode(replace(COMMAND, valid=valid)), 0)
    assert [e.unknown for e in heard.events if isinstance(e, JointsUnknown)] == [0, JOINTS, 0]
    assert heard.watch.known()


def test_counters_are_what_came_since_and_begin_anew_with_a_process(heard: Heard) -> None:
    commands = ArrivalCounts(arrived=100, lost=2, late=1, repeated=0)
    heard.statistics(slave_metrics(commands=commands, ticks=Ticks(900, 3)))
    assert heard.watch.row()["lost"] == 2.0
    heard.watch.restarted("slave")
    heard.statistics(slave_metrics(commands=replace(commands, lost=5), ticks=Ticks(1000, 4)))
    row = heard.watch.row()
    assert (row["lost"], row["slave_ticks"], row["slave_missed"]) == (5.0, 1000.0, 4.0)


def test_a_command_that_comes_after_all_is_not_lost(heard: Heard) -> None:
    """What was lost shrinks then: that is no new process, whose whole count would be new."""
    commands = ArrivalCounts(arrived=100, lost=40, late=0, repeated=0)
    heard.statistics(slave_metrics(commands=commands))
    assert heard.watch.row()["lost"] == 40.0
    heard.statistics(slave_metrics(commands=ArrivalCounts(101, 39, 1, 0), due=DueMetrics(141, 40)))
    row = heard.watch.row()
    assert (row["due"], row["gone"]) == (141.0, 39.0)
    assert (row["lost"], row["late"], row["arrived"]) == (-1.0, 1.0, 1.0)


def test_commands_without_a_lease_are_no_refusals(heard: Heard) -> None:
    heard.statistics(slave_metrics(guard=guard_metrics(dropped={"lease": 30, "age": 2, "clock": 1})))
    assert heard.watch.row()["refused"] == 3.0


def test_the_master_s_round_trips_are_means_of_what_came_since(heard: Heard) -> None:
    heard.statistics(master_metrics(commanded(round_trip_ms=Summary(10, 1.0))))
    heard.watch.row()
    heard.statistics(master_metrics(commanded(round_trip_ms=Summary(20, 2.0))))
    row = heard.watch.row()
    assert (row["round_trip_n"], row["round_trip_ms"]) == (10.0, 3.0)


def test_what_is_no_message_changes_nothing(heard: Heard) -> None:
    for take in (heard.watch.on_state, heard.watch.on_command, heard.watch.on_statistics):
        take(b"nonsense", 0)
    assert heard.events == []
    assert heard.watch.row()["undecodable"] == 3.0, "and is counted"


# the robot's joints


def motion(*rows: tuple[float, str, float]) -> MotionWatch:
    """Seen: seconds, guard, and where every joint stands, rad."""
    seen = MotionWatch(SKELETON)
    for sequence, (at_s, guard, angle_rad) in enumerate(rows):
        at_ns, angles = round(at_s * NS_PER_S), np.full(JOINTS, angle_rad)
        state = replace(STATE, sequence=sequence, sent_ns=at_ns, guard=guard)
        seen.see(replace(state, position_rad=angles, setpoint_rad=angles))
    return seen


def at_50_hz(seconds: float, guard: str, angle: Any, from_s: float = 0.0) -> list[tuple[float, str, float]]:
    return [(from_s + i / 50.0, guard, float(angle(i / 50.0))) for i in range(round(seconds * 50))]


def test_standstill_is_when_the_last_joint_came_to_rest() -> None:
    moving = at_50_hz(1.0, "track", lambda t: t)
    braking = at_50_hz(2.0, "hold", lambda t: 1.0 + min(t, 0.4), from_s=1.0)
    found = motion(*moving, *braking).standstill_s(NS_PER_S)
    assert found == pytest.approx(0.4, abs=0.03)


def test_a_robot_that_moves_on_never_stands() -> None:
    assert motion(*at_50_hz(3.0, "track", lambda t: t)).standstill_s(NS_PER_S) is None


def test_a_robot_that_was_not_heard_is_not_said_to_stand() -> None:
    assert motion(*at_50_hz(1.2, "track", lambda t: 0.0)).standstill_s(NS_PER_S) is None
    assert MotionWatch(SKELETON).standstill_s(0) is None


def test_braking_is_no_straying_but_what_comes_after_is() -> None:
    braking = at_50_hz(2.0, "hold", lambda t: min(t, 0.5))
    seen = motion(*braking)
    assert seen.take_strayed() == 0.0
    later = at_50_hz(1.0, "hold", lambda t: 0.5 + 0.05 * t, from_s=2.0)
    assert motion(*braking, *later).take_strayed() == pytest.approx(0.05, abs=0.002)


def test_another_process_s_robot_elsewhere_is_no_motion() -> None:
    before = at_50_hz(2.0, "hold", lambda t: 1.0, from_s=100.0)
    after = at_50_hz(2.0, "hold", lambda t: 0.0)
    assert motion(*before, *after).take_strayed() == 0.0


def test_of_a_robot_that_follows_nothing_is_said() -> None:
    assert motion(*at_50_hz(2.0, "track", lambda t: t)).take_strayed() is None


@pytest.mark.parametrize(("spoil", "strayed_rad"), [("silent", 0.5), ("nan", math.inf)])
def test_an_unread_joint_hides_no_other_and_nan_may_be_anywhere(spoil: str, strayed_rad: float) -> None:
    seen = MotionWatch(SKELETON)
    for sequence in range(100):
        state = replace(STATE, sequence=sequence, sent_ns=sequence * NS_PER_S // 50, guard="hold")
        angles, valid = np.zeros(JOINTS), np.ones(JOINTS, np.bool_)
        angles[1] = 0.5 * (sequence > 60)
        if sequence > 50:
            angles[0], valid[0] = np.nan, spoil == "nan"
        seen.see(replace(state, position_rad=angles, setpoint_rad=angles, encoder_valid=valid))
    assert seen.take_strayed() == strayed_rad
