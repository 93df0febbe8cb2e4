"""Figures of a made-up run whose operator, link, clock, losses and outage are known to the nanosecond."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from common.link.config import LinkConfig
from common.metrics.parts import Ticks
from common.metrics.slave import ArrivalCounts, DueMetrics
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Command, CommandEcho, CommandStamps, RobotState, Statistics, Truth
from deploy.experiments.trial.cell.aftermath import aftermath
from deploy.experiments.trial.cell.judge import judged
from deploy.experiments.trial.cell.measure import excerpt, measure, one_way_percentiles_ms
from deploy.experiments.trial.cell.plan import CellKey, Setup
from deploy.experiments.trial.cell.recording import (
    CellCourse,
    CellMessages,
    ScriptedOutage,
    counts,
    on_masters_clock,
)
from deploy.experiments.trial.cell.result import CellStatus
from slave.config import SlaveConfig
from tests.published import commanded, guard_metrics, master_metrics, slave_metrics

MS, S = 1_000_000, 1_000_000_000
SKELETON = load_skeleton("nursing")
CONFIG = SlaveConfig(robot="robot-1", link=LinkConfig())
JOINT = SKELETON.joint_names.index("right_shoulder_pitch")
REST_RAD = np.clip(0.0, SKELETON.lower_rad, SKELETON.upper_rad)
VALID = np.ones(len(SKELETON.joints), np.bool_)
SECONDS, TRANSIT_NS, LAG_NS = 12, 40 * MS, 60 * MS
BEGIN_NS = 7 * S


def posture(at_ns: int) -> Array:
    position: Array = REST_RAD.copy()
    position[JOINT] = 0.5 * np.sin(2.0 * (at_ns - BEGIN_NS) / S)
    return position


def command(number: int) -> Command:
    at_ns = BEGIN_NS + 80 * MS * number
    stamps = CommandStamps(at_ns, at_ns + MS, at_ns + 2 * MS, at_ns + 3 * MS)
    return Command(
        "robot-1", 7, number, 16 * number, stamps, True, VALID, posture(at_ns), np.zeros(len(VALID))
    )


def echo(one: Command, transit_ns: int = TRANSIT_NS) -> CommandEcho:
    received_ns = one.stamps.put_ns + transit_ns
    return CommandEcho(
        one.sequence, one.stamps.put_ns, received_ns, received_ns + MS, written_ns=received_ns + 5 * MS
    )


def state(sent_ns: int, newest: CommandEcho | None, guard: str = "track") -> RobotState:
    position = posture(sent_ns - LAG_NS)
    return RobotState(
        "robot-1", sent_ns // MS, sent_ns, sent_ns, guard, "", "nurse-1", VALID, position, position, newest,
        master_offset_ns=0, offset_bound_ns=8 * MS,
    )  # fmt: skip


def slave_told(
    at_ns: int, arrived: int, lost: int, age: int = 0, p50: float = 40.0, accepted: int = 0
) -> Statistics:
    dropped = {"age": age} if age else {}
    metrics = slave_metrics(
        ticks=Ticks(at_ns // (5 * MS), 0),
        guard=guard_metrics(dropped=dropped, accepted=accepted),
        commands=ArrivalCounts(arrived, lost, 0, 0),
        one_way_recent_us=tuple([round(1000 * p50)] * 12),
    )
    return Statistics(at_ns, metrics)


def master_told(at_ns: int, round_trip_recent_us: Sequence[int]) -> Statistics:
    robot = commanded(round_trip_recent_us=tuple(round_trip_recent_us))
    return Statistics(at_ns, master_metrics(robot, ticks=Ticks(at_ns // (5 * MS), 0)))


@cache
def true_course() -> tuple[Truth, ...]:
    """What the operator did, 200 times a second from 1 s before."""
    return tuple(
        Truth(t, BEGIN_NS + 5 * MS * t, posture(BEGIN_NS + 5 * MS * t), np.zeros(len(VALID)))
        for t in range(-200, SECONDS * 200)
    )


def recording(lost: Iterable[int] = (), guards: dict[int, str] | None = None) -> CellMessages:
    """Commands at 12.5 Hz, all accepted but the lost ones; states at 50 Hz; `guards` by number of state."""
    commands = [command(n) for n in range(round(SECONDS * 12.5))]
    echoes = [echo(c) for c in commands if c.sequence not in set(lost)]
    received_ns = [e.received_ns for e in echoes]
    states = []
    for k in range(SECONDS * 50):
        at_ns = BEGIN_NS + 20 * MS * k
        heard = bisect_left(received_ns, at_ns)
        states.append(state(at_ns, echoes[heard - 1] if heard else None, (guards or {}).get(k, "track")))
    ends = (BEGIN_NS + S, BEGIN_NS + (SECONDS - 1) * S)
    return CellMessages(
        commands,
        states,
        list(true_course()),
        [slave_told(ends[0], 12, 0), slave_told(ends[1], 132, 5, age=3),
         *(master_told(at_ns, [81_000, 99_000]) for at_ns in ends)],
    )  # fmt: skip


def unmoved(heard: CellMessages) -> CellMessages:
    """Without the operator's truth, so that no motion is judged: that takes 0.6 s."""
    return replace(heard, truth=[])


@pytest.fixture(scope="module")
def figures() -> dict[str, float | None]:
    course = CellCourse(
        recording(), max_age_s=0.3, shared_clock=True, cpu_percent={"master": 20.0, "slave": 30.0},
        up_bytes_s=9000.0, down_bytes_s=41_000.0,
        after=after(0.6), outage=ScriptedOutage(CUT_NS, BACK_NS, BACK_NS + 700 * MS, ACT_NS),
    )  # fmt: skip
    return measure(course, CONFIG)


def test_one_way_is_told_by_the_slave_and_checked_by_the_shared_clock(figures: dict[str, float]) -> None:
    assert figures["one_way_p50_ms"] == pytest.approx(40.0)
    assert figures["one_way_bound_ms"] == 8.0
    assert figures["true_one_way_p50_ms"] == pytest.approx(40.0)
    assert figures["round_trip_p50_ms"] == 90.0
    assert figures["age_p50_ms"] == pytest.approx(3 + 40 + 5)


def test_one_way_and_round_trip_are_of_the_judged_time() -> None:
    # the first word of a stretch tells of the second before it: a slow start-up is no part of it
    of_seconds: list[list[int]] = [[900_000] * 12, [40_000, 41_000], [], [42_000, 400_000]]
    words: list[Statistics] = []
    for n, us in enumerate(of_seconds):
        at_ns = BEGIN_NS + n * S
        words += [Statistics(at_ns, slave_metrics(one_way_recent_us=tuple(us))), master_told(at_ns, us)]
    figures = measure(
        CellCourse(unmoved(replace(recording(), statistics=words)), 0.3, shared_clock=True), CONFIG
    )
    assert figures["one_way_p50_ms"] == figures["round_trip_p50_ms"] == pytest.approx(41.5)
    # one that the guard refuses for its age has taken its time all the same
    assert figures["one_way_p99_ms"] == figures["round_trip_p99_ms"] == pytest.approx(400.0, abs=11.0)


def test_commands_that_were_due_and_never_came_are_in_the_figures() -> None:
    """Both sides stalled for 5 s: every number came, and each that came was fast."""
    told = [
        Statistics(BEGIN_NS, slave_metrics(commands=ArrivalCounts(12, 0, 0, 0), due=DueMetrics(12, 0))),
        Statistics(
            BEGIN_NS + 10 * S,
            slave_metrics(
                commands=ArrivalCounts(75, 0, 0, 0),
                due=DueMetrics(137, 62),
                one_way_recent_us=(40_000,) * 63,
                one_way_missing_recent_us=tuple(5_000_000 - 80_000 * n for n in range(62)),
            ),
        ),
    ]
    figures = measure(
        CellCourse(unmoved(replace(recording(), statistics=told)), 0.3, shared_clock=True), CONFIG
    )
    assert figures["delivered"] == pytest.approx(100.0 * 63 / 125)
    assert figures["one_way_p99_ms"] == pytest.approx(40.0)
    corrected = figures["one_way_corrected_p99_ms"]
    assert corrected is not None
    assert corrected > 4800.0


@pytest.mark.parametrize("without", ["commands", "echoes"])
def test_a_cell_without_a_single_command_failed(without: str) -> None:
    heard = recording()
    heard = (
        replace(heard, commands=[])
        if without == "commands"
        else replace(heard, states=[replace(s, echo=None) for s in heard.states])
    )
    key = CellKey(Setup("tcp", "lan", "predict"), 0)
    cell = judged(key, CellCourse(unmoved(heard), 0.3, shared_clock=True), CONFIG, {}, ())
    assert cell.status is CellStatus.FAILED
    assert "no command was" in cell.why
    whole = judged(key, CellCourse(unmoved(recording()), 0.3, shared_clock=True), CONFIG, {}, ())
    assert whole.status is CellStatus.DONE


def test_a_robot_unheard_after_the_outage_is_not_called_safe() -> None:
    outage = ScriptedOutage(CUT_NS, BACK_NS, BACK_NS + 700 * MS, ACT_NS)
    deaf = aftermath(replace(after(0.6), states=[]), outage, 0.3)
    assert (deaf["moved_alone"], deaf["stale_accepted"]) == (None, None)
    course = CellCourse(
        unmoved(recording()), 0.3, shared_clock=True, after=replace(after(0.6), states=[]), outage=outage
    )
    cell = judged(CellKey(Setup("tcp", "lan", "predict"), 0), course, CONFIG, {}, ())
    assert cell.status is CellStatus.FAILED


def test_ages_that_nobody_knows_are_not_fresh() -> None:
    outage = ScriptedOutage(CUT_NS, BACK_NS, BACK_NS + 700 * MS, ACT_NS)
    assert aftermath(after(0.6), outage, 0.3)["stale_accepted"] == 0.0
    assert aftermath(replace(after(0.6), commands=[]), outage, 0.3)["stale_accepted"] is None
    silent_slave = aftermath(replace(after(0.6), statistics=[]), outage, 0.3)
    assert (silent_slave["stale_accepted"], silent_slave["stale_refused"]) == (None, None)


def test_what_the_slave_did_not_tell_is_no_zero() -> None:
    figures = measure(
        CellCourse(unmoved(replace(recording(), statistics=[])), 0.3, shared_clock=True), CONFIG
    )
    assert (figures["refused"], figures["clamps"], figures["delivered"]) == (None, None, None)


def test_without_a_shared_clock_nothing_is_called_true() -> None:
    figures = measure(CellCourse(unmoved(recording()), max_age_s=0.3, shared_clock=False), CONFIG)
    assert figures.get("true_one_way_p50_ms") is None
    assert figures["one_way_p50_ms"] == pytest.approx(40.0)


def test_motion_is_judged_at_the_same_instant(figures: dict[str, float]) -> None:
    assert figures["lag_ms"] == pytest.approx(60.0, abs=0.2)
    # a sine of 0.5 rad at 2 rad/s, 60 ms late: the difference is 2·0.5·sin(0.06)·cos(…)
    assert figures["rmse_deg"] == pytest.approx(np.degrees(np.sin(0.06)) / np.sqrt(2), rel=0.05)
    assert figures["aligned_rmse_deg"] < 0.05
    assert figures["roughness"] == pytest.approx(1.0, abs=0.05)
    assert 0.0 < figures["rmse_over_latest"] < 1.0
    assert figures["tracked"] == 100.0
    assert figures["holds"] == 0.0


def test_what_was_delivered_is_counted_between_the_slaves_words(figures: dict[str, float]) -> None:
    assert figures["delivered"] == pytest.approx(100.0 * 120 / 125)
    assert figures["refused"] == 3.0
    assert figures["accepted"] == 100.0
    assert figures["ticks_missed"] == 0.0


def test_a_lost_command_is_not_accepted_and_one_under_way_is_not_lost() -> None:
    figures = measure(
        CellCourse(unmoved(recording(lost=range(50, 65))), max_age_s=0.3, shared_clock=True), CONFIG
    )
    # the last of 150 are still on their way when the recording ends
    assert figures["accepted"] == pytest.approx(100.0 * (1 - 15 / 150), abs=0.5)


def test_each_time_that_the_guard_leaves_track_counts_once() -> None:
    guards = dict.fromkeys((*range(200, 220), *range(400, 410)), "hold") | dict.fromkeys(
        range(410, 430), "align"
    )
    figures = measure(CellCourse(unmoved(recording(guards=guards)), max_age_s=0.3, shared_clock=True), CONFIG)
    assert figures["holds"] == 2.0
    assert figures["tracked"] == pytest.approx(100.0 * (1 - 50 / 600))


def test_cost_is_told_in_thousands_of_bytes(figures: dict[str, float]) -> None:
    assert (figures["up_kb_s"], figures["down_kb_s"]) == (9.0, 41.0)
    assert figures["flow_s"] == pytest.approx(0.6), "and the outage is judged with the rest"
    assert (figures["cpu_master"], figures["cpu_slave"]) == (20.0, 30.0)


def test_only_what_grew_in_the_judged_time_is_counted() -> None:
    assert counts(recording()) == {"dropped": {"age": 3}}


def test_percentiles_of_the_excerpt_are_of_accepted_commands() -> None:
    percentiles = one_way_percentiles_ms(recording())
    assert len(percentiles) == 101
    assert percentiles[50] == pytest.approx(40.0)
    found = excerpt(recording(), CONFIG)
    assert found is not None
    assert found.joint == "right_shoulder_pitch"
    assert found.at_s[-1] == pytest.approx(6.0, abs=0.05)
    assert max(found.operator_deg) == pytest.approx(np.degrees(0.5), abs=0.5)


def test_nothing_heard_gives_no_figure_and_no_error() -> None:
    figures = measure(CellCourse(CellMessages([], [], [], []), max_age_s=0.3, shared_clock=True), CONFIG)
    assert all(value is None for value in figures.values())
    assert excerpt(CellMessages([], [], [], []), CONFIG) is None
    assert one_way_percentiles_ms(CellMessages([], [], [], [])) == []


CUT_NS, BACK_NS, ACT_NS = BEGIN_NS + S, BEGIN_NS + 3 * S, BEGIN_NS + 5 * S


def after(
    first_accepted_s: float, stale_age_ms: float | None = None, moves_at_s: float | None = None
) -> CellMessages:
    """Hold 0.2 s after the cut, commands from `first_accepted_s` on, engaged at ACT_NS, track 1.5 s later."""
    commands = [command(n) for n in range(round(8 * 12.5))]
    first_ns = BACK_NS + round(first_accepted_s * S)
    echoes = [echo(c) for c in commands if c.stamps.put_ns + TRANSIT_NS + MS >= first_ns]
    echoes[0] = replace(echoes[0], accepted_ns=first_ns)
    if stale_age_ms is not None:
        old = commands[5]
        accepted_ns = BACK_NS + 300 * MS
        assert accepted_ns - old.stamps.sampled_ns > 0
        old_echo = replace(echo(old), accepted_ns=old.stamps.sampled_ns + round(stale_age_ms * MS))
        moved = replace(old.stamps, sampled_ns=accepted_ns - round(stale_age_ms * MS))
        commands[5] = replace(old, stamps=moved)
        echoes.insert(0, replace(old_echo, accepted_ns=accepted_ns, received_ns=accepted_ns - MS))
    states = []
    for k in range(51, 8 * 50):
        at_ns = BEGIN_NS + 20 * MS * k
        newest = [e for e in echoes if e.accepted_ns < at_ns]
        guard = "track" if at_ns < CUT_NS + 200 * MS or at_ns > ACT_NS + 1500 * MS else "hold"
        if moves_at_s is not None and BACK_NS + round(moves_at_s * S) < at_ns < ACT_NS:
            guard = "align"
        states.append(state(at_ns, newest[-1] if newest else None, guard))
    return CellMessages(
        commands, states, [], [slave_told(CUT_NS, 0, 0), slave_told(BEGIN_NS + 7 * S, 0, 0, age=4)]
    )


def outage_figures(recorded: CellMessages, act_ns: int | None = ACT_NS) -> dict[str, float | None]:
    return aftermath(recorded, ScriptedOutage(CUT_NS, BACK_NS, BACK_NS + 700 * MS, act_ns), max_age_s=0.3)


def test_an_outage_is_told_from_the_links_return_to_the_operators_act() -> None:
    figures = outage_figures(after(0.6))
    assert figures["held_s"] == pytest.approx(0.2, abs=0.03)
    assert figures["flow_s"] == pytest.approx(0.6)
    assert figures["ready_s"] == pytest.approx(0.7)
    assert figures["track_again_s"] == pytest.approx(1.5, abs=0.03)
    assert figures["stale_accepted"] == 0.0
    assert figures["stale_refused"] == 4.0
    assert figures["moved_alone"] == 0.0


@pytest.mark.parametrize(("age_ms", "stale"), [(299.0, 0.0), (301.0, 1.0)])
def test_a_command_is_stale_where_it_is_older_than_the_guard_may_take(age_ms: float, stale: float) -> None:
    assert outage_figures(after(0.6, stale_age_ms=age_ms))["stale_accepted"] == stale


@pytest.mark.parametrize(("unseen", "stale"), [(0, 0.0), (4, 0.0), (5, 1.0), (20, 16.0)])
def test_a_stale_burst_is_proven_by_the_slave_s_counter(unseen: int, stale: float) -> None:
    heard = after(0.6)
    begun_ns, ended_ns = CUT_NS, BEGIN_NS + 7 * S
    found = {s.echo.sequence: s.echo.accepted_ns for s in heard.states if s.echo is not None}
    seen = sum(begun_ns < at_ns <= ended_ns for at_ns in found.values())
    words = [
        slave_told(begun_ns, 0, 0, accepted=100),
        slave_told(ended_ns, 0, 0, accepted=100 + seen + unseen),
    ]
    # one came every 80 ms and the limit is 300 ms: four of those under way can have been fresh
    assert outage_figures(replace(heard, statistics=words))["stale_accepted"] == stale


def test_a_robot_that_moves_before_the_operators_act_is_noticed() -> None:
    assert outage_figures(after(0.6, moves_at_s=1.0))["moved_alone"] == 1.0


def test_a_robot_that_never_comes_back_has_no_times() -> None:
    silent = after(0.6)
    silent = replace(silent, states=[replace(s, echo=None) for s in silent.states if s.sent_ns < ACT_NS])
    figures = outage_figures(silent, act_ns=None)
    assert figures["flow_s"] is None
    assert figures["track_again_s"] is None


def test_a_robot_already_in_hold_did_not_hold_for_the_cut_link() -> None:
    held = after(0.6)
    held = replace(held, states=[replace(s, guard="hold") if s.sent_ns < ACT_NS else s for s in held.states])
    assert (
        outage_figures(replace(held, states=[s for s in held.states if s.sent_ns > CUT_NS]))["held_s"] is None
    )


def test_a_robot_that_is_not_heard_at_all_gives_no_error() -> None:
    assert outage_figures(CellMessages([], [], [], []), act_ns=None)["flow_s"] is None


def test_a_robots_own_clock_is_brought_onto_the_masters() -> None:
    ahead_ns = -3 * S
    there = [
        replace(
            s, sent_ns=s.sent_ns - ahead_ns, encoder_ns=s.encoder_ns - ahead_ns, master_offset_ns=ahead_ns,
            echo=None if s.echo is None else replace(
                s.echo, received_ns=s.echo.received_ns - ahead_ns, accepted_ns=s.echo.accepted_ns - ahead_ns,
                written_ns=s.echo.written_ns - ahead_ns),
        )
        for s in recording().states
    ]  # fmt: skip
    here = on_masters_clock(there)
    assert [s.encoder_ns for s in here] == [s.encoder_ns for s in recording().states]
    assert [s.echo for s in here] == [s.echo for s in recording().states]
    untrusted = [replace(s, offset_bound_ns=-1) for s in there]
    assert on_masters_clock(untrusted) == [], "stamps that cannot be compared are not"
