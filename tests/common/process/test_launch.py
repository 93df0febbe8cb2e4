"""`python -m master FILE` and `python -m slave FILE`: a side alone, its mistakes one line each."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from common.config.section import Section
from common.errors import TandemError
from common.metrics.tree import Metrics, WriteMetrics
from common.process.launch import launch

ROOT = Path(__file__).parents[3]


class OneKey(Section):
    robot: str


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "side.toml"
    path.write_text('robot = "robot-1"\n')
    monkeypatch.setattr(sys, "argv", ["python -m side", str(path)])
    return path


def test_a_side_runs_with_its_file_and_what_is_set_over_it(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["python -m side", str(file), "--set", 'robot="robot-2"'])
    robots = []

    async def side(config: OneKey, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
        robots.append(config.robot)
        write_metrics(Metrics())
        assert not stop.is_set()

    assert launch("side", OneKey, side) == 0
    assert robots == ["robot-2"]
    assert capsys.readouterr().err == ""


def test_what_a_side_cannot_do_is_told_line_by_line(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async def side(config: OneKey, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
        raise TandemError("no bus\nno link")

    assert launch("side", OneKey, side) == 1
    assert capsys.readouterr().err == "side: no bus\nside: no link\n"


def test_a_mistake_in_the_file_starts_nothing(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.write_text("robots = 1\n")

    async def side(config: OneKey, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
        raise AssertionError("started")

    assert launch("side", OneKey, side) == 1
    said = capsys.readouterr().err.splitlines()
    assert sorted(said) == [
        f"side: {file}: robot = (not set): expected this key to be set",
        f"side: {file}: robots = 1: expected no such key (is it misspelt?)",
    ]


def test_debug_shows_the_traceback(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["python -m side", str(file), "--debug"])

    async def side(config: OneKey, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
        raise TandemError("no bus")

    with pytest.raises(TandemError):
        launch("side", OneKey, side)


@pytest.mark.parametrize(("role", "other"), [("master", "slave"), ("slave", "master")])
def test_each_side_starts_by_its_module_and_refuses_the_other_s_file(role: str, other: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", role, f"deploy/examples/{other}.toml"],
        capture_output=True, text=True, timeout=60, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) >= 3
    assert all(line.startswith(f"{role}: deploy/examples/{other}.toml: ") for line in lines)
