"""What a demo of several robots reports of each, and when it counts as failed."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from rich.console import Console

from common.errors import TandemError
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary, Ticks
from common.metrics.slave import SlaveMetrics
from common.wire.messages import Command, CommandStamps, RobotState
from deploy.experiments.demo.options import DemoOptions
from deploy.experiments.demo.report import DemoReport, RunNotes, make_report
from deploy.experiments.demo.view import print_report
from deploy.harness.operator import HoldRecord
from deploy.harness.rig import Rig, robot_name, slave_name
from deploy.measure import Trace
from tests.published import guard_metrics, master_metrics, slave_metrics

JOINTS = ("left_elbow_pitch",)
ROBOTS = 8
HELD = HoldRecord("robot-3", 2.0, "track", "no encoder", 1.0, 0, "the host kept its time", counts=True)
COUNTED = slave_metrics(
    ticks=Ticks(4000, 3),
    guard=guard_metrics(received=150, accepted=140, dropped={"lease": 10}),
    one_way_ms=Summary(140, p99=1.25),
    end_to_end_ms=Summary(140, p99=30.5),
)
WELL = master_metrics()
COMMAND = Command(
    "robot-1", 1, 0, 0, CommandStamps(0, 0, 0, 0), True, np.ones(1, np.bool_), np.zeros(1), np.zeros(1)
)


def state(guard: str) -> RobotState:
    zeros, valid = np.zeros(1), np.ones(1, np.bool_)
    return RobotState("r", 1, 1, 1, guard, "", "nurse-1", valid, zeros, zeros, None, 0, 1)


def report(
    lost_by: int = 0,
    ended: dict[str, int] | None = None,
    problem: str = "",
    counted_last: SlaveMetrics | None = COUNTED,
    master: MasterMetrics | None = WELL,
) -> DemoReport:
    """Of a run in which robot 1 was engaged first, and one robot was in `track` for half of the time only."""

    def child(counted: MasterMetrics | SlaveMetrics | None) -> SimpleNamespace:
        return SimpleNamespace(metrics=lambda kind: counted, cpu_percent=12.34, rss_mb=98.76)

    def observer(number: int) -> SimpleNamespace:
        guards = ["track"] * 100 if number != lost_by else ["track", "hold"] * 50
        if number == -lost_by:
            guards = ["hold"] * 100
        if number == 1:
            guards = ["hold"] * 50 + guards
        states = [state(guard) for guard in guards]
        return SimpleNamespace(
            trace=Trace(JOINTS), states=states, commands=[COMMAND], guards_seen=["track"], video=None
        )

    numbers = range(1, ROBOTS + 1)
    slaves = [slave_name(n) for n in numbers]
    observers = {robot_name(n): observer(n) for n in numbers}
    children = {name: child(COUNTED) for name in slaves} | {"master": child(master)}
    children[slaves[-1]] = child(counted_last)
    rig = SimpleNamespace(
        slaves=slaves, observers=observers, observer=observers["robot-1"], children=children
    )
    statuses: dict[str, int | None] = {**dict.fromkeys(children, 0), **(ended or {})}
    return make_report(DemoOptions(robots=ROBOTS), cast(Rig, rig), statuses, RunNotes([HELD], None, problem))


def test_each_robot_has_its_own_figures() -> None:
    made = report()
    assert made.problems == []
    assert list(made.robots) == [f"robot-{i}" for i in range(1, 9)]
    assert made.robots["robot-8"].accepted == 140
    assert made.robots["robot-8"].in_track == 1.0
    assert made.cpu_percent["slave-8"] == 12.3


def test_failed_processes_and_robots_that_never_tracked_are_named() -> None:
    made = report(lost_by=3, ended={"slave-5": 1}, problem="robot-3 held 3 times within 20 s")
    assert made.problems == ["slave-5 ended with status 1", "robot-3 held 3 times within 20 s"]
    assert made.robots["robot-3"].in_track == 0.5
    assert made.notes.holds == [HELD]


def test_only_what_follows_the_first_tracking_counts_as_left() -> None:
    assert report().robots["robot-1"].in_track == 1.0


def test_a_robot_that_never_tracked_is_a_problem() -> None:
    assert report(lost_by=-2).problems == ["robot-2 never reached track"]


def test_missing_metrics_and_missing_commands_are_problems() -> None:
    assert report(counted_last=None).problems == ["robot-8 left no metrics"]
    deaf = replace(COUNTED, guard=replace(COUNTED.guard, received=0))
    assert report(counted_last=deaf).problems == ["no command reached robot-8: it was not judged"]
    assert report(master=None).problems == ["the master left no metrics"]


def test_the_table_has_a_row_each_and_fits() -> None:
    out = io.StringIO()
    print_report(report(lost_by=3), Console(file=out, width=80))
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    rows = {line.split()[0]: line.split()[1:] for line in lines if "robot-" in line and "%" in line}
    assert rows["robot-2"] == ["100%", "3", "4000", "12", "1.2", "30.5", "–", "–"]
    assert rows["robot-3"][0] == "50%"
    assert "robot-3 held at 2.0 s for 1.0 s: no encoder" in out.getvalue()


def test_several_robots_follow_the_simulated_operator_only() -> None:
    slave = DemoOptions(robots=2).overrides()["slave"]
    assert 'camera.source="off"' in slave
    assert "process.realtime_priority=0" in slave
    assert 'camera.source="robot"' in DemoOptions().overrides()["slave"]
    with pytest.raises(TandemError, match="--robots 2: several robots need the simulated operator"):
        DemoOptions(robots=2, servos="canopen").check()
    with pytest.raises(TandemError, match="omit --replay, --record and --servos"):
        DemoOptions(robots=2, record=Path("first-run")).check()


def test_a_demo_does_not_write_over_an_earlier_ones_recordings(tmp_path: Path) -> None:
    DemoOptions(record=tmp_path).check()
    (tmp_path / "slave.mcap").touch()
    with pytest.raises(TandemError, match=r"slave\.mcap is there; expected a folder without recordings"):
        DemoOptions(record=tmp_path).check()
