"""For verdicts that are a limit alone: all is well up to the limit, and just above it one turns red."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from common.errors import TandemError
from common.recording import RecorderCounters
from deploy.experiments.bench.targets import BENCH
from deploy.experiments.demo.targets import BY_PROFILE
from deploy.experiments.soak.judge.growth import (
    BLOCKS_H,
    DRIFT_MS_H,
    IN_USE_MB_H,
    MOVED_MS_H,
    RSS_MB_H,
    drift,
    handles,
    in_use,
    memory,
)
from deploy.experiments.trial.cell.plan import CellKey, Setup
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.cell.result import CellStatus as CellStatus
from deploy.experiments.trial.report.spread import SetupResults
from deploy.experiments.trial.report.targets import LIMITS, SetupLimit, judge
from deploy.harness.faults.judge import standing_amiss
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.table import VIRTUAL
from deploy.harness.faults.virtual import VirtualFault, _judge, try_on_virtual_clock
from deploy.measure.accuracy import SIDES
from deploy.measure.stillness import stillness
from deploy.measure.target import ReportTarget, judge_targets
from deploy.measure.verdict import Outcome
from deploy.ops.record.record import RecordOptions, Taken, _check
from slave.guard import State
from tests.deploy.experiments.soak.conftest import STORY, Make

LONG = 3600
TARGETS = {f"{name}: {t.name}": (ts, t) for name, ts in {**BY_PROFILE, "bench": BENCH}.items() for t in ts}


def tree(targets: tuple[ReportTarget, ...], values: dict[str, float]) -> dict[str, Any]:
    """A report that holds each target's figure at its limit, or at the value given."""
    made: dict[str, Any] = {}
    for target in targets:
        for side in SIDES:
            at = made
            *folders, leaf = (key.replace("*", side) for key in target.path)
            for key in folders:
                at = at.setdefault(key, {})
            at[leaf] = values.get(target.name, target.limit)
    return made


@pytest.mark.parametrize("name", TARGETS)
def test_each_target_turns_red_just_above_its_limit_and_no_other_does(name: str) -> None:
    targets, target = TARGETS[name]
    assert all(v.passed for v in judge_targets(tree(targets, {}), targets))
    above = judge_targets(tree(targets, {target.name: target.limit + 1e-6}), targets)
    assert [v.name for v in above if v.passed is False] == [target.name]


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: f"{limit.figure} {limit.profile}")
def test_each_limit_of_a_trial_is_missed_just_above_it(limit: SetupLimit) -> None:
    setup = Setup("tcp", limit.profile or "lan", limit.strategy or "predict")

    def met(value: float) -> bool:
        values = {"moved_alone": 0.0, limit.figure: value}
        cells = [Cell(CellKey(setup, n), CellStatus.DONE, values=values) for n in range(3)]
        [found] = judge([SetupResults(setup, cells, {})], [limit])
        return found.passed is True

    assert met(limit.at_most)
    assert not met(limit.at_most + 1e-6)


DRIFTS = {
    "one_way_p50_ms": DRIFT_MS_H,
    "round_trip_ms": DRIFT_MS_H,
    "written_p50_ms": DRIFT_MS_H,
    "end_to_end_ms": MOVED_MS_H,
}


@pytest.mark.parametrize("column", DRIFTS)
def test_each_latency_that_drifts_fails(make: Make, column: str) -> None:
    def failing(per_hour: float) -> int:
        seen = make(LONG, **{column: lambda at_s: 0.5 + per_hour * at_s / 3600.0})
        return sum(v.outcome is Outcome.FAILED for v in drift(seen))

    assert failing(0.5 * DRIFTS[column]) == 0
    assert failing(4.0 * DRIFTS[column]) == 1


@pytest.mark.parametrize("process", ["master", "slave", "recorder", "soak"])
def test_each_process_that_leaks_fails(make: Make, process: str) -> None:
    def failing(of: Any, column: str, per_hour: float, events: Any = STORY) -> list[str]:
        leak = {f"{process}_{column}": lambda at_s: 100.0 + per_hour * at_s / 3600.0}
        return [v.name for v in of(make(LONG, events, **leak)) if v.outcome is Outcome.FAILED]

    both = [f"{process}'s memory grows", f"{process} grows between faults"]
    assert failing(memory, "rss_mb", 0.5 * RSS_MB_H) == []
    assert failing(memory, "rss_mb", 4.0 * RSS_MB_H) == both
    assert failing(handles, "fds", 100.0) == [f"{process}'s descriptors grow"]
    assert failing(handles, "threads", 100.0) == [f"{process}'s threads grow"]
    if process in ("master", "slave"):
        assert failing(in_use, "in_use_mb", 4.0 * IN_USE_MB_H) == [f"{process}'s bytes in use grow"]
        assert failing(in_use, "blocks", 4.0 * BLOCKS_H) == [f"{process}'s objects in use grow"]


@pytest.fixture(scope="module")
def cut() -> tuple[VirtualFault, Scene]:
    """The link is cut, and all is as it must be."""
    fault = next(fault for fault in VIRTUAL if fault.name == "link cut")
    scene = Scene()
    scene.to(fault.begins)
    scene.begin()
    fault.act(scene)
    scene.run.run(3.0)
    assert _judge(fault, scene).wrong == ()
    return fault, scene


@pytest.mark.parametrize(
    ("stricter", "words"),
    [
        ({"ends": State.ESTOP}, "ended in hold"),
        ({"reacts_s": 0.001}, "in hold after"),
        ({"stands_s": 0.001}, "stands after"),
        ({"refused_by": frozenset({"sequence"})}, "no command was refused by sequence"),
    ],
)
def test_a_row_of_the_fault_matrix_fails_where_it_is_not_kept(
    cut: tuple[VirtualFault, Scene], stricter: dict[str, Any], words: str
) -> None:
    fault, scene = cut
    [wrong] = _judge(replace(fault, **stricter), scene).wrong
    assert words in wrong


def test_what_was_granted_or_let_through_is_wrong(
    cut: tuple[VirtualFault, Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    fault, scene = cut
    monkeypatch.setattr(scene, "granted", ["an engage"])
    monkeypatch.setattr(scene, "foul", 3)
    assert _judge(fault, scene).wrong == ("3 foul commands were accepted", "an engage was granted")


def test_joints_that_were_to_go_on_and_strayed_are_wrong() -> None:
    fault = next(fault for fault in VIRTUAL if fault.strays_deg is not None and fault.begins is State.TRACK)
    assert any("strayed by" in words for words in try_on_virtual_clock(replace(fault, strays_deg=-1.0)).wrong)


def test_a_robot_that_never_stands_is_wrong(cut: tuple[VirtualFault, Scene]) -> None:
    fault, scene = cut
    figures = replace(stillness(scene.course(), scene.skeleton, np.ones(25, np.bool_)), standstill_s=None)
    [words] = standing_amiss(fault, figures)
    assert "still moves at the end of the trial" in words


@pytest.mark.parametrize(
    ("counters", "words"),
    [
        (RecorderCounters(9, 7, 1, 1, ""), "the disk was too slow for 2 of 9 messages"),
        (RecorderCounters(9, 7, 2, 0, "no space left"), "the recording ended early: no space left"),
    ],
)
def test_a_recording_that_is_not_whole_ends_with_an_error(counters: RecorderCounters, words: str) -> None:
    tape = SimpleNamespace(counters=lambda: counters)
    options = cast(RecordOptions, SimpleNamespace(out="a.mcap", robot="robot-1", may_miss=True))
    with pytest.raises(TandemError, match=words):
        _check(options, cast(Any, tape), Taken(0), 0)
