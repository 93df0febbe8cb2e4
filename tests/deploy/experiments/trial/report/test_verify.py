"""A trial's tables computed again: identical, and each planted change is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from deploy import cli
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.report.verify import differences
from deploy.study.seal import seal
from tests.deploy.experiments.trial.report.test_report import whole as whole  # the fixture


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "trial"))


def test_every_table_is_what_the_cells_give(copy: Path) -> None:
    assert differences(Folder(copy)).differences == []
    seal(copy)
    shown = CliRunner().invoke(cli.app, ["trial", "verify", str(copy)])
    assert shown.exit_code == 0, shown.output
    assert "every table is what the cells give; 0 of" in shown.output


def test_cells_alone_prove_nothing(copy: Path) -> None:
    """Whoever changes a cell, and writes the report again, leaves nothing to be found."""
    shown = CliRunner().invoke(cli.app, ["trial", "verify", str(copy)])
    assert isinstance(shown.exception, TandemError)
    assert "no recording was computed, and there is no seal" in str(shown.exception)


def test_a_changed_figure_of_the_report_is_named(copy: Path) -> None:
    report = json.loads((copy / "report.json").read_text())
    setup = next(iter(report["compared"]["setups"]))
    figure = next(iter(report["compared"]["setups"][setup]["figures"]))
    report["compared"]["setups"][setup]["figures"][figure]["median"] += 1.0
    (copy / "report.json").write_text(json.dumps(report))
    assert differences(Folder(copy)).differences == [
        f"report.json: compared.setups.{setup}.figures.{figure}.median is not what the cells give"
    ]


def test_a_changed_line_of_the_table_and_a_changed_cell_are_named(copy: Path) -> None:
    lines = (copy / "cells.csv").read_text().splitlines()
    (copy / "cells.csv").write_text("\n".join([*lines[:2], lines[2] + "0", *lines[3:]]) + "\n")
    assert differences(Folder(copy)).differences == ["cells.csv: line 3 is not what the cells give"]
    (copy / "cells.csv").write_text("\n".join(lines[:-1]) + "\n")
    assert differences(Folder(copy)).differences == [
        f"cells.csv: has {len(lines) - 1} lines, the cells give {len(lines)}"
    ]


def test_a_sealed_trial_with_a_changed_cell_is_refused(copy: Path) -> None:
    seal(copy)
    assert "the seal is whole" in CliRunner().invoke(cli.app, ["trial", "verify", str(copy)]).output
    cell = sorted((copy / "cells").glob("*.json"))[0]
    cell.write_text(cell.read_text().replace("1", "2", 1))
    result = CliRunner().invoke(cli.app, ["trial", "verify", str(copy)])
    assert isinstance(result.exception, TandemError)
    assert f"cells/{cell.name}" in result.output


def test_a_cell_beside_its_copy_under_another_name_is_named(copy: Path) -> None:
    """Else a changed cell would not be seen, as its unchanged copy is what is judged."""
    cell = sorted((copy / "cells").glob("*.json"))[0]
    shutil.copy(cell, cell.with_name("~.json"))
    with pytest.raises(TandemError, match=rf"~\.json: it holds the cell {cell.stem}"):
        differences(Folder(copy))


def test_a_folder_without_a_report_says_so(copy: Path) -> None:
    (copy / "report.json").unlink()
    with pytest.raises(TandemError, match="no report that can be read"):
        differences(Folder(copy))


def test_a_changed_line_of_the_page_is_named_and_another_drawing_of_a_plot_is_not(copy: Path) -> None:
    page = copy / "report.html"
    lines = page.read_text("utf-8").splitlines()
    number = next(i for i, line in enumerate(lines) if "<td" in line and "ms" not in line)
    page.write_text("\n".join([*lines[:number], lines[number] + "9", *lines[number + 1 :]]) + "\n", "utf-8")
    assert differences(Folder(copy)).differences == [
        f"report.html: line {number + 1} is not what the cells give"
    ]
    page.write_text("\n".join(lines).replace('src="data:image/svg', 'src="data:image/other') + "\n", "utf-8")
    assert differences(Folder(copy)).differences == []


def test_a_table_among_the_plots_is_named(copy: Path) -> None:
    page = copy / "report.html"
    old = page.read_text("utf-8")
    page.write_text(old.replace("<h2>Plots</h2>", "<h2>Plots</h2>\n<table><td>0.01</table>"), "utf-8")
    found = differences(Folder(copy)).differences
    assert any("report.html: line" in words for words in found), found
    page.write_text(old.replace("<figcaption><b>", "<figcaption><b>No "), "utf-8")
    assert differences(Folder(copy)).differences


def test_the_ranking_uses_the_weights_that_lie_in_the_folder(copy: Path) -> None:
    tasks = copy / "tasks.toml"
    tasks.write_text(tasks.read_text("utf-8").replace("weight = ", "weight = 1", 1), "utf-8")
    assert any("compared.rankings" in words for words in differences(Folder(copy)).differences)
