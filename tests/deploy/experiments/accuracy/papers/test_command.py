from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from deploy.cli import app
from deploy.experiments.accuracy.papers import experiments
from deploy.experiments.accuracy.papers.figures import Experiment, PaperValue


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    good = Experiment("A", "good", lambda seed: [PaperValue("error", "°", (0.1 * seed,), 1.0, 0.5)])
    bad = Experiment("B", "bad", lambda seed: [PaperValue("lateness", "ms", (10.0 * seed,), 60.0, 15.0)])
    monkeypatch.setattr(experiments, "EXPERIMENTS", (good, bad))


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["accuracy", "papers", "--jobs", "1", *arguments])
    return result.exit_code, result.output


def test_every_experiment_is_printed_and_reported(tmp_path: Path) -> None:
    status, output = run("--seeds", "2", "--report", str(tmp_path / "papers.json"))
    assert status == 0, output
    assert "good" in output
    assert "targets failed: 1" in output
    report = json.loads((tmp_path / "papers.json").read_text("utf-8"))
    assert list(report["experiments"]) == ["A", "B"]
    assert (report["seeds"], report["failed"]) == (2, 1)


def test_only_those_named_run_and_strict_fails_where_one_misses() -> None:
    assert run("--seeds", "2", "--only", "a", "--strict")[0] == 0
    status, output = run("--seeds", "2", "--only", "B", "--strict")
    assert status == 1
    assert "good" not in output


def test_an_experiment_there_is_not_is_refused_and_so_is_a_folder() -> None:
    status, output = run("--only", "A,Q")
    assert status == 2
    assert "there is no Q" in output
    status, output = run("--report", "no/such/folder/x.json")
    assert status == 2
    assert "no folder" in output
