"""One path against two on the virtual clock: a cut that makes the robot hold passes unnoticed over two."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from common.errors import TandemError
from deploy.experiments.trial.command import app
from deploy.experiments.trial.paths import view
from deploy.experiments.trial.paths.command import SHORTEST_S
from deploy.experiments.trial.paths.study import PathFault, PathRow, lossy, run
from deploy.sim.network.profile import load_profile

WIFI, CELLULAR = load_profile("wifi"), load_profile("4g")
SECONDS = 6.0


@pytest.mark.timeout(400)
def test_a_cut_holds_the_robot_over_one_path_and_not_over_two() -> None:
    alone, beside = (run(PathFault.CUT, WIFI, second, SECONDS, seed=1) for second in (None, CELLULAR))
    assert (alone.paths, beside.paths) == (1, 2)
    assert alone.holds >= 1
    assert beside.holds == 0
    assert alone.followed < 0.4, "counted at the robot: of the states, those of the cut are missing"
    assert beside.followed == 1.0
    assert alone.missing > 0.1
    assert beside.missing < 0.05
    assert beside.kb_s == pytest.approx(2.0 * alone.kb_s, rel=0.15)


@pytest.mark.timeout(400)
def test_the_command_runs_to_its_end(tmp_path: Path) -> None:
    asked = ["paths", "--profiles", "wifi,4g", "--seconds", f"{SHORTEST_S:g}", "--report", str(tmp_path)]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "paths.json").read_text())
    assert [(row["fault"], row["paths"]) for row in rows] == [(f, n) for f in PathFault for n in (1, 2)]
    assert all(row["holds"] == 0 and row["followed"] == 1.0 for row in rows if row["paths"] == 2)
    cut_alone = rows[4]
    assert cut_alone["holds"] == 1
    assert cut_alone["followed"] < 0.7


@pytest.mark.parametrize("seconds", ["3", "4.9"])
def test_a_run_too_short_to_engage_again_is_refused(tmp_path: Path, seconds: str) -> None:
    """It said that a robot over one path, which was cut, had followed all the time."""
    done = CliRunner().invoke(app, ["paths", "--seconds", seconds, "--report", str(tmp_path)])
    assert done.exit_code == 2
    assert not (tmp_path / "paths.json").exists()


def test_a_profile_that_loses_keeps_all_else() -> None:
    ways = lossy(CELLULAR).ways
    assert ways.to_robot.loss_percent == ways.to_operator.loss_percent == 20.0
    assert ways.to_robot.delay_ms == CELLULAR.ways.to_robot.delay_ms
    assert ways.to_operator.rate_mbit == CELLULAR.ways.to_operator.rate_mbit


def test_the_table_is_printed_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = PathRow(PathFault.CUT, 2, 0, 1.0, 0.01, None, 99.5)
    monkeypatch.setattr(view, "rows", lambda *_: iter([row]))
    console = Console(record=True, width=100)
    view.run_paths_trial(("wifi", "4g"), 6.0, 1, tmp_path, console)
    assert "first cut for 1.5 s" in console.export_text()
    assert json.loads((tmp_path / "paths.json").read_text())[0]["kb_s"] == 99.5
    with pytest.raises(TandemError, match="expected two networks"):
        view.run_paths_trial(("wifi",), 6.0, 1, tmp_path, console)
