"""What may be chosen, what a network needs set, and what the command says to a person."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import ConfigError, NetworkError, TandemError
from common.link.endpoint import TRANSPORTS
from deploy.cli import app
from deploy.experiments.trial.cell.choice import choose, why_impossible
from deploy.experiments.trial.cell.folder import Folder
from deploy.sim.network import profile_names
from tests.deploy.experiments.trial.made_up import PLAN, cells


def test_names_are_taken_once_and_all_is_all() -> None:
    assert choose("--transports", " udp, tcp,udp ") == ("udp", "tcp")
    assert choose("--transports", "all") == TRANSPORTS
    assert choose("--profiles", "all") == tuple(profile_names())
    assert "predict" in choose("--strategies", "all")


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        ("--transports", "tcp,smoke", "smoke.*expected.*udp"),
        ("--strategies", "guess", "guess.*predict"),
        ("--profiles", "6g", "6g.*one of lan"),
        ("--transports", " , ", "all, or some of"),
    ],
)
def test_what_there_is_not_is_named_with_what_there_is(option: str, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        choose(option, text)


def test_a_network_of_ones_own_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "ward.toml"
    file.write_text("[both]\ndelay_ms = 3.0\n", "utf-8")
    assert choose("--profiles", f"lan,{file}") == ("lan", str(file))
    file.write_text("[both]\ndelay = 3.0\n", "utf-8")
    with pytest.raises(ConfigError, match=r"both\.delay.*no such key"):
        choose("--profiles", str(file))


def test_only_what_does_not_cross_hosts_is_impossible() -> None:
    why = {t: why_impossible(t) for t in TRANSPORTS}
    assert [t for t, reason in why.items() if reason] == ["unixsock-stream"]
    assert "does not cross hosts" in str(why["unixsock-stream"])


def tandem(*arguments: str) -> tuple[str, BaseException | None]:
    result = CliRunner().invoke(app, ["trial", *arguments], env={"COLUMNS": "200"})
    return result.output, result.exception


def test_help_says_what_it_does_with_an_example() -> None:
    for words in (["--help"], ["report", "--help"], ["serve", "--help"]):
        said, _ = tandem(*words)
        assert "Example:" in said


def test_a_mistake_is_told_before_anything_is_started(tmp_path: Path) -> None:
    _, error = tandem("--transports", "smoke", "--report", str(tmp_path / "r"))
    assert isinstance(error, ConfigError)
    _, error = tandem("--outage", "0.9", "--report", str(tmp_path / "r"))
    assert isinstance(error, TandemError)
    assert "--outage 0.9: expected 0, or 1 s or longer" in str(error)
    weights = tmp_path / "tasks.toml"
    weights.write_text("tasks = []", "utf-8")
    _, error = tandem("--tasks", str(weights), "--report", str(tmp_path / "r"))
    assert isinstance(error, ConfigError)
    assert not (tmp_path / "r").exists()


def test_who_may_not_make_hosts_is_told_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.sim.network.namespaces.why_not", lambda: "needs root")
    _, error = tandem("--report", str(tmp_path / "r"))
    assert isinstance(error, NetworkError)
    assert "--remote" in str(error)
    assert not (tmp_path / "r").exists()


def test_a_report_is_built_again_from_its_cells_with_other_weights(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "r")
    folder.begin(PLAN)
    for one in cells():
        folder.keep(one)
    weights = tmp_path / "tasks.toml"
    weights.write_text(
        '[[tasks]]\nname = "lift"\ntitle = "Lifting"\nneeds = "little lag"\n'
        'criteria = [{ figure = "lag_ms", weight = 1, good = 0.0, bad = 100.0 }]\n',
        "utf-8",
    )
    said, error = tandem("report", str(folder.path), "--tasks", str(weights))
    assert error is None
    assert "Lifting" in said
    assert "report.html" in said
    ranked = json.loads((folder.path / "report.json").read_text("utf-8"))["compared"]["rankings"]
    assert {r["task"] for r in ranked} == {"lift"}


def test_a_folder_without_a_trial_is_refused(tmp_path: Path) -> None:
    _, error = tandem("report", str(tmp_path))
    assert isinstance(error, TandemError)
    assert "no trial" in str(error)
