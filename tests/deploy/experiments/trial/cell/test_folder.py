"""Cells as files: whole, gone on with, refused where they are something else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from common.errors import TandemError
from deploy.experiments.trial.cell.figures import FIGURES, printed, rounded
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.run import missing
from tests.deploy.experiments.trial.made_up import PLAN, cell, cells


def as_rounded(one: Cell) -> Cell:
    return Cell.of_tree(json.loads(json.dumps(one.tree())))


def test_a_cell_survives_json_and_twice_is_no_different_from_once() -> None:
    one = cell(PLAN.cells()[0])
    once = as_rounded(one)
    assert once.key == one.key
    assert once.remarks == one.remarks
    assert once.counts == one.counts
    assert once.excerpt is not None
    assert once.excerpt.joint == "right_shoulder_pitch"
    assert as_rounded(once).tree() == once.tree() == one.tree()


def test_a_figure_that_is_none_is_a_mistake() -> None:
    with pytest.raises(KeyError, match="rmse_degrees"):
        rounded({"rmse_degrees": 1.0})


def test_figures_are_rounded_as_they_are_printed() -> None:
    values = rounded({"rmse_deg": 1.23456, "lag_ms": -0.4, "roughness": None})
    assert values["rmse_deg"] == 1.23
    assert str(values["lag_ms"]) == "0.0", "and never minus nothing"
    assert values["roughness"] is None
    assert set(values) == {f.name for f in FIGURES}
    assert printed("lag_ms", -12.3, unit=True) == "−12 ms"
    assert printed("rmse_deg", 1.0, unit=True) == "1.00°"
    assert printed("rmse_deg", None) == "–"


@pytest.mark.parametrize(
    "spoil", [{"version": 99}, {"status": "fine"}, {"figures": None}, {"excerpt": {"x": 1}}]
)
def test_what_is_no_cell_is_said_to_be_none(spoil: dict[str, object]) -> None:
    with pytest.raises(TandemError, match="cell"):
        Cell.of_tree({**cell(PLAN.cells()[0]).tree(), **spoil})


def test_a_second_run_skips_what_is_there_and_tries_again_what_failed(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "report")
    folder.begin(PLAN)
    assert missing(PLAN, folder) == PLAN.cells()
    first, second, third, *rest = PLAN.cells()
    folder.keep(cell(first))
    folder.keep(Cell(second, CellStatus.FAILED, "the robot is not heard"))
    folder.keep(Cell(third, CellStatus.IMPOSSIBLE, "does not cross hosts"))
    assert missing(PLAN, folder) == [second, *rest]


def test_a_wider_plan_runs_only_its_new_cells(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.begin(PLAN)
    for one in cells():
        folder.keep(one)
    wider = replace(PLAN, transports=("tcp", "quic"))
    folder.begin(wider)
    assert {key.setup.transport for key in missing(wider, folder)} == {"quic"}
    assert folder.plan().transports == ("tcp", "udp", "quic"), "the report shows all"


def test_another_plan_changes_nothing_in_the_folder(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.begin(PLAN)
    before = (tmp_path / "plan.json").read_bytes()
    with pytest.raises(TandemError, match=r"seconds was 20\.0, is 5\.0.*Give another --report"):
        folder.begin(replace(PLAN, seconds=5.0))
    assert (tmp_path / "plan.json").read_bytes() == before


def test_a_spoiled_file_is_named(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.begin(PLAN)
    folder.keep(cell(PLAN.cells()[0]))
    [file] = (tmp_path / "cells").glob("*.json")
    file.write_text("{", "utf-8")
    with pytest.raises(TandemError, match=file.name):
        folder.cells()


def test_a_folder_without_a_trial_says_so(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="no trial"):
        Folder(tmp_path).plan()


def test_a_folder_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "report").write_text("a file", "utf-8")
    with pytest.raises(TandemError, match="cannot be written"):
        Folder(tmp_path / "report").begin(PLAN)
