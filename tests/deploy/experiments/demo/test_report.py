"""The report's tree, of a run on the virtual clock in place of three processes."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rich.console import Console

from common.metrics.bus import BusMetrics
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary, Ticks
from common.metrics.slave import SlaveMetrics
from common.wire.messages import Action
from deploy.experiments.bench.targets import BENCH
from deploy.experiments.demo.options import DemoOptions
from deploy.experiments.demo.report import DemoReport, RunNotes, make_report
from deploy.experiments.demo.targets import BY_PROFILE, DEMO, of_demo
from deploy.experiments.demo.tree import report_tree
from deploy.experiments.demo.view import print_report
from deploy.harness.host import HostMetrics
from deploy.harness.operator import HoldRecord
from deploy.harness.rig import Rig
from deploy.measure import Trace
from deploy.measure.target import judge_targets
from deploy.measure.verdict import verdict_table
from deploy.sim.world.copy import copied
from deploy.sim.world.world import VirtualWorld, WorldSettings
from slave.pipeline import SlavePipeline
from tests.published import master_metrics, slave_metrics

ENDED_WELL: dict[str, int | None] = {"master": 0, "suit": 0, "slave": 0}


@dataclass
class FakeChild:
    role: str
    slave: SlaveMetrics
    published: bool = True
    cpu_percent: float = 12.34
    rss_mb: float = 56.78

    def metrics(self, kind: type[MasterMetrics | SlaveMetrics]) -> MasterMetrics | SlaveMetrics | None:
        if not self.published:
            return None
        if kind is SlaveMetrics:
            return self.slave
        return master_metrics(
            ticks=Ticks(5, 0),
            frames_in_to_put_ms=Summary(9, 1.0, 1.0, 1.5, 2.0),
            buses={"suit": BusMetrics(up=True)},
        )


def told_by(slave: SlavePipeline) -> SlaveMetrics:
    """What the slave of a run on the virtual clock would have published."""
    budget, counters = slave.traffic.journeys.budget, slave.guard.counters
    return slave_metrics(
        ticks=Ticks(5, 0),
        guard=counters.metrics(str(slave.guard.state), slave.guard.reason),
        stages_ms=budget.summary(),
        end_to_end_ms=budget.total(),
        one_way_ms=slave.traffic.one_way.summary(),
        one_way_corrected_ms=slave.traffic.due.corrected.summary(),
        commands=slave.traffic.arrivals.metrics(),
        due=slave.traffic.due.metrics(),
    )


def rig(run: VirtualWorld, guards_seen: list[str]) -> Rig:
    observer = SimpleNamespace(
        trace=run.trace, commands=run.commands, states=run.states, guards_seen=guards_seen, video=None
    )
    children = {role: FakeChild(role, told_by(run.slave)) for role in ENDED_WELL}
    observers = {"robot-1": observer}
    return cast(
        Rig, SimpleNamespace(observer=observer, observers=observers, slaves=("slave",), children=children)
    )


@cache
def followed(profile: str) -> VirtualWorld:
    """8 s on one host: one clock, half a millisecond of link. No test changes it."""
    run = VirtualWorld(
        WorldSettings(slave_ahead_ns=0, slave_drift_ppm=0.0, one_way_ns=500_000, profile=profile)
    )
    run.run(5.0, until=lambda: bool(run.commands and run.commands[-1].valid.all() and run.commands[-1].lease))
    run.run(1.0)
    assert run.ask(Action.ENGAGE).done
    run.run(8.0)
    return run


@cache
def reported(profile: str) -> DemoReport:
    run = rig(followed(profile), ["hold", "align", "track"])
    return make_report(DemoOptions(profile=profile), run, ENDED_WELL)


@pytest.fixture
def tracked() -> VirtualWorld:
    return followed("nursing")


@pytest.fixture
def report() -> DemoReport:
    return reported("nursing")


def tree_of(report: DemoReport) -> dict[str, Any]:
    tree: dict[str, Any] = report_tree(report)
    return tree


def text(report: DemoReport) -> str:
    out = io.StringIO()
    print_report(report, Console(file=out, width=80, color_system=None))
    return out.getvalue()


def test_a_good_run_has_no_problem_and_is_plain_json(report: DemoReport) -> None:
    assert report.problems == []
    assert "the robot never held by itself" in text(report)
    assert "the host itself was not measured" in " ".join(text(report).split())
    assert json.loads(json.dumps(tree_of(report), allow_nan=False)) == tree_of(report)
    predict = tree_of(report)["motion_by_strategy"]["predict"]
    assert tree_of(report)["motion_lag_ms"] == pytest.approx(predict["lag_ms"], abs=3.0)


def test_the_replay_of_the_run_s_own_strategy_moves_as_the_run_did(report: DemoReport) -> None:
    motion, replayed = tree_of(report)["motion"], tree_of(report)["motion_by_strategy"]["predict"]
    for figure in ("rmse_deg", "aligned_rmse_deg", "roughness"):
        assert replayed[figure] == pytest.approx(motion[figure], rel=0.1), figure


def test_predict_shows_a_third_of_the_error_of_latest_in_the_same_run(report: DemoReport) -> None:
    latest = tree_of(report)["motion_by_strategy"]["latest"]
    over_latest = tree_of(report)["rmse_over_latest"]
    assert over_latest == pytest.approx(tree_of(report)["motion"]["rmse_deg"] / latest["rmse_deg"])
    assert over_latest <= 1 / 3
    found = {v.name: v for v in judge_targets(tree_of(report), DEMO)}["same-instant RMSE / latest"]
    assert (found.measured, found.passed) == (over_latest, True)
    for words in ("same commands, each strategy", "this run", "latest, replayed", "RMSE / latest"):
        assert words in text(report)


def test_a_run_without_truth_is_judged_by_the_rest(tracked: VirtualWorld) -> None:
    blind = rig(tracked, ["track"])
    blind.observer.trace = Trace(tracked.trace.joint_names)
    report = make_report(DemoOptions(), blind, ENDED_WELL)
    assert (report.problems, report.comparison, report.motion) == ([], None, None)
    assert (tree_of(report)["motion_by_strategy"], tree_of(report)["rmse_over_latest"]) == ({}, None)
    shown = text(report)
    assert "no truth to judge by" in shown
    assert "each strategy" not in shown


def test_every_problem_is_named(tracked: VirtualWorld) -> None:
    failed = rig(tracked, ["hold"])
    failed.observer.trace = Trace(tracked.trace.joint_names)
    failed.observer.states = []
    cast(FakeChild, failed.children["slave"]).published = False
    notes = RunNotes(problem="robot-1 held 3 times within 20 s")
    problems = make_report(DemoOptions(), failed, {**ENDED_WELL, "slave": -9}, notes).problems
    assert problems == [
        "slave ended with status -9",
        "robot-1 left no metrics",
        "robot-1 never reached track",
        "robot-1 held 3 times within 20 s",
    ]


def test_holds_and_what_the_host_missed_stand_beside_our_own_ticks(report: DemoReport) -> None:
    host = HostMetrics(Ticks(90, 40), longest_ms=143.0, priority=True, steal_percent=4.2)
    held = HoldRecord("robot-1", 6.3, "track", "no encoder", 1.7, 0, "the host kept its time", counts=True)
    report = replace(report, notes=RunNotes([held], host))
    assert tree_of(report)["holds"][0]["reason"] == "no encoder"
    assert tree_of(report)["host"]["ticks"] == {"expected": 90, "missed": 40}
    shown = " ".join(text(report).split())
    assert (
        "ticks missed: master 0 of 5, robot 0 of 5; by the host itself, of a reference loop: 40 of 90"
        in shown
    )
    assert "still for 143 ms at most, 4.2 % of its time stolen" in shown
    assert "robot-1 held at 6.3 s for 1.7 s: no encoder (the host kept its time)" in shown


@pytest.mark.long
def test_a_hand_s_report_has_five_joints_curves_and_paper_b_s_targets() -> None:
    report = reported("hand")
    tree = json.loads(json.dumps(tree_of(report), allow_nan=False))
    assert tree["options"]["profile"] == "hand"
    assert tree["options"]["motion"] == "grasp"
    assert list(tree["synergies"]) == [f"right_{f}" for f in ("thumb", "index", "middle", "ring", "little")]
    assert tree["worst_joint"]["max_deg"] == max(row["max_deg"] for row in tree["accuracy"].values())
    found = {v.name: v.passed for v in judge_targets(tree, BY_PROFILE["hand"])}
    assert found["finger joint's RMSE, the worst (paper B)"]
    assert found["finger joint's error, the largest (paper B)"]
    shown = text(report)
    for words in ("right_little_dipj", "as a robot's joints", "(paper B)"):
        assert words in shown
    for words in ("η", "elbow"):
        assert words not in shown


@pytest.mark.parametrize(
    "profile",
    # of the others a run of their own must be made first
    [p if p == "nursing" else pytest.param(p, marks=pytest.mark.long) for p in sorted(BY_PROFILE)],
)
def test_every_target_s_path_leads_to_a_figure_in_a_real_report(profile: str) -> None:
    """A renamed figure would not be missed otherwise: its target would only not be judged."""
    tree = json.loads(json.dumps(tree_of(reported(profile)), allow_nan=False))
    nowhere = [v.name for v in judge_targets(tree, BY_PROFILE[profile]) if v.measured is None]
    assert nowhere == []


def test_a_missing_figure_is_not_judged_and_is_neither_zero_nor_met() -> None:
    for targets in (*BY_PROFILE.values(), BENCH):
        for verdict in judge_targets({}, targets):
            assert (verdict.measured, verdict.passed) == (None, None)
    assert "not judged" in shown_verdicts({})


def shown_verdicts(tree: dict[str, object]) -> str:
    out = io.StringIO()
    Console(file=out, width=80).print(verdict_table("targets", judge_targets(tree, DEMO)))
    return out.getvalue()


def test_a_run_in_which_no_command_reached_the_robot_failed(tracked: VirtualWorld) -> None:
    deaf = rig(tracked, ["track"])
    deaf.observer.trace = Trace(tracked.trace.joint_names)
    child = cast(FakeChild, deaf.children["slave"])
    child.slave = replace(child.slave, guard=replace(child.slave.guard, received=0))
    assert make_report(DemoOptions(), deaf, ENDED_WELL).problems == [
        "no command reached robot-1: it was not judged"
    ]


def test_a_run_in_which_no_command_was_observed_failed(tracked: VirtualWorld) -> None:
    deaf = rig(tracked, ["track"])
    deaf.observer.commands = []
    assert make_report(DemoOptions(), deaf, ENDED_WELL).problems == [
        "no command was observed: nothing was judged"
    ]


@pytest.mark.long
def test_both_sides_still_for_5_s_miss_a_target_and_are_said(tracked: VirtualWorld) -> None:
    run = copied(tracked)
    run.stand_still(5.0)
    run.run(5.0)
    report = make_report(DemoOptions(), rig(run, ["track"]), ENDED_WELL)
    verdict = {v.name: v for v in judge_targets(tree_of(report), DEMO)}["commands due that never came"]
    assert verdict.passed is False
    assert verdict.measured == pytest.approx(62, abs=4)
    assert "that were missing when due" in " ".join(text(report).split())
    assert "this stage does not show how soon the robot answers" in " ".join(text(report).split())


def test_paper_b_s_60_ms_are_of_one_way_and_lag(report: DemoReport) -> None:
    tree = tree_of(report)
    lag_ms = max(0.0, tree["motion_lag_ms"])
    assert tree["one_way_plus_lag_ms"] == pytest.approx(tree["one_way_ms"]["corrected"]["p99"] + lag_ms)
    slow = {**tree, "one_way_plus_lag_ms": 61.0}
    found = {v.name: v.passed for v in judge_targets(slow, BY_PROFILE["hand"])}
    assert found["one way p99 + motion lag (paper B)"] is False


@pytest.mark.parametrize(("p99_ms", "core_percent", "met"), [(5.0, 25.0, True), (5.1, 25.1, False)])
def test_canopen_drives_are_judged_by_answers_and_the_robot_s_core(
    p99_ms: float, core_percent: float, met: bool
) -> None:
    tree = {
        "cpu_percent": {"slave": core_percent},
        "servos": {"times_ms": {"sync_to_positions": {"p99": p99_ms}}},
    }
    found = {v.name: v.passed for v in judge_targets(tree, of_demo("nursing", "canopen"))}
    assert found["SYNC → all positions, p99"] is met
    assert found["robot, of one core"] is met
    assert of_demo("nursing", "mujoco") == DEMO
