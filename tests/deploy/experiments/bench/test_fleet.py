"""The fleet's bench: what is judged, and one small fleet that really runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from common.process.pacing import DueTick
from deploy.experiments.bench.fleet import run as fleet_run
from deploy.experiments.bench.fleet.fit import watching_cost
from deploy.experiments.bench.fleet.run import (
    FleetCell,
    FleetOptions,
    MeasuredCell,
    cells,
    growth_percent,
    judge,
    measure_fleet,
)
from deploy.experiments.bench.fleet.workers import turns_due
from deploy.measure.verdict import Outcome

ONE = MeasuredCell(
    FleetCell("", 0, 0),
    1,
    0.0,
    [],
    100.0,
    0.0,
    0.0,
    0.0,
    1.0,
    0.0,
    0.0,
    measured=True,
    core_percent_runs=[0.0],
)


def measured(
    name: str, cost: float, robots: int = 0, commanded: int = 0, enough: bool = True
) -> MeasuredCell:
    return replace(ONE, cell=FleetCell(name, robots, commanded), core_percent=cost, measured=enough)


def test_the_targets() -> None:
    rows = [
        measured("nobody watched", 0.2),
        measured("100 watched", 1.2, 100),
        measured("300 watched", 3.2, 300),
        measured("1000 watched", 11.0, 1000),
        measured("1 commanded", 2.0, 1, 1),
        measured("1 commanded + 99 watched", 7.0, 100, 1),
        measured("100 commanded", 60.1, 100, 100),
    ]
    above, everybody, linear, line = judge(rows)
    assert (above.outcome, above.measured) == (Outcome.PASSED, 5.0)
    assert everybody.outcome is Outcome.FAILED
    assert linear.measured == pytest.approx(8.0)
    assert linear.outcome is Outcome.PASSED
    assert line.outcome is Outcome.PASSED


def test_a_fixed_part_is_told_from_the_cost_of_each() -> None:
    found = watching_cost({0: 0.4, 10: 1.1, 100: 2.0, 300: 4.0, 1000: 11.0})
    assert found is not None
    assert (found.fixed_percent, found.each_percent) == pytest.approx((1.0, 0.01))
    assert found.furthest_percent == pytest.approx(0.0, abs=1e-9)
    bent = watching_cost({10: 1.0, 100: 1.0, 300: 9.0, 1000: 100.0})
    assert bent is None or bent.furthest_percent > 20.0
    assert watching_cost({10: 1.0, 100: 2.0}) is None, "two sizes lie on a line by themselves"


def test_a_fleet_that_the_machine_could_not_serve_is_not_judged() -> None:
    rows = [measured("1 commanded", 2.0), measured("100 commanded", 1.0, enough=False)]
    assert {verdict.outcome for verdict in judge(rows)} == {Outcome.NOT_JUDGED}
    assert growth_percent([measured("100 watched", 1.0, 100)]) is None


def test_the_cells_grow_to_the_fleet_that_was_asked_for() -> None:
    names = [cell.name for cell in cells(FleetOptions(1000, 2, 1.0))]
    assert names == [
        "nobody watched", "10 watched", "30 watched", "100 watched", "300 watched", "1000 watched",
        "1 commanded", "1 commanded + 99 watched", "100 commanded", "1000 robots, 2 nurses",
    ]  # fmt: skip


@pytest.mark.live
def test_a_small_fleet_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = FleetCell("4 robots, 2 nurses", 4, 1, 2)
    monkeypatch.setattr(fleet_run, "cells", lambda _: [cell])
    report = measure_fleet(FleetOptions(4, 2, 3.0), tmp_path, lambda _: None)
    (one,) = report.cells
    assert len(one.each_nurse_percent) == 2
    assert one.states_hz > 10.0, "of the one that it commands"
    assert one.summaries_hz > 2.0, "of all"
    assert one.commands_hz > 5.0
    assert report.tree()["verdicts"]


@pytest.mark.parametrize(
    ("missed", "parts"), [(0, [5]), (3, [2, 3, 4, 5]), (500, [6, 7, 8, 9, 0, 1, 2, 3, 4, 5])]
)
def test_a_late_loop_makes_up_for_the_turns_that_it_missed_once_each(missed: int, parts: list[int]) -> None:
    assert turns_due(DueTick(25, 0, missed)) == parts
