"""`tandem calibrate live`: its options reach the guide, and its mistakes are one clear line."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from common.errors import ConfigError, TandemError
from deploy import cli
from deploy.calibrate.live import run as live_run
from deploy.calibrate.live.guide import GuideOptions
from deploy.examples.profiles import EXAMPLES


def run(line: str) -> None:
    CliRunner().invoke(cli.app, shlex.split(f"calibrate live {line}"), catch_exceptions=False)


def test_every_option_reaches_the_guide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[GuideOptions] = []

    def session(config: Any, options: GuideOptions, *_: Any) -> None:
        heard.append(options)
        raise TandemError("enough")

    monkeypatch.setattr(live_run, "LiveSession", session)
    asked = "--what align,mag --still-s 4 --attitudes 30 --coverage 0.7 --tumble-s 50 --move-joints-s 15"
    with pytest.raises(TandemError, match="enough"):
        run(f"{EXAMPLES}/master.toml --out {tmp_path} {asked}")
    assert heard == [
        GuideOptions(
            ("mag", "align"), 4.0, 30, coverage=0.7, tumble_s=50.0, move_joints_s=15.0, by_word=False
        )
    ]


def test_mistakes_are_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TandemError, match=r"--out .*file: cannot be made"):
        run(f"{EXAMPLES}/master.toml --out {tmp_path}/file")
    with pytest.raises(ConfigError, match="--what = 'legs': expected one or more of imu, mag, align"):
        run(f"{EXAMPLES}/master.toml --out {tmp_path} --what legs")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
