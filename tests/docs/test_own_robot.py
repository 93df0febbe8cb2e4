"""docs/extending.md, *Own robot*: its commands and its one edit, with a robot that is not ours."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.config.load import load_config
from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.cli import app
from deploy.sim.world.world import VirtualWorld, WorldSettings
from slave.config import SlaveConfig
from tests.robots.imported import ROBOTS

ROOT = Path(__file__).parents[2]
SECTION = (ROOT / "docs/extending.md").read_text("utf-8").partition("## Own robot\n")[2].partition("\n## ")[0]
(COMMANDS,) = (block.splitlines() for block in re.findall(r"```sh\n(.*?)```", SECTION, re.DOTALL))
((FILE, EDIT),) = re.findall(r"```toml\n# (\S+?),[^\n]*\n(.*?)```", SECTION, re.DOTALL)


def run(command: str) -> str:
    program, *arguments = shlex.split(command)
    assert program == "tandem"
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, f"{command}: {done.output} {done.exception}"
    return done.output


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a stranger keeps his URDF."""
    shutil.copy(ROBOTS / "upper_body.urdf", tmp_path / "robot.urdf")
    monkeypatch.chdir(tmp_path)
    load_skeleton.cache_clear()
    return tmp_path


def test_five_commands_and_ten_lines_are_enough() -> None:
    assert len(COMMANDS) <= 5
    assert len(EDIT.strip().splitlines()) <= 10
    assert COMMANDS[-1].startswith("tandem demo --profile ")


def test_from_the_urdf_to_tracking(here: Path) -> None:
    """The demo itself on the virtual clock; `test_the_demo_itself` runs its processes."""
    importing, checking, demonstrating = COMMANDS
    assert "guessed" in run(importing)
    assert "elbows bent: nothing left over" in run(checking.partition(" --picture")[0])
    folder = demonstrating.split()[-1]
    refused = ['servos.backend="canopen"']
    with pytest.raises(
        ConfigError, match=r"servos\.backend = .canopen.: expected mujoco while .* are guesses"
    ):
        load_config(here / folder / "slave.toml", SlaveConfig, refused)
    text, count = re.subn(r"unconfirmed = \[.*?\]\n", EDIT, (here / FILE).read_text("utf-8"), flags=re.DOTALL)
    assert count == 1
    (here / FILE).write_text(text, "utf-8")
    load_skeleton.cache_clear()
    world = VirtualWorld(WorldSettings(one_way_ns=500_000, profile=folder))
    world.engage()
    world.run(4.0)
    assert world.slave.guard.state == "track", world.slave.guard.reason
    assert load_config(here / folder / "slave.toml", SlaveConfig, refused).servos.backend == "canopen"


@pytest.mark.live
@pytest.mark.timeout(400)
def test_the_demo_itself(here: Path) -> None:
    """With the picture, and the processes of the demo, which runs for 8 s of its 20."""
    *before, demonstrating = COMMANDS
    for command in (*before, f"{demonstrating} --seconds 8"):
        program = [sys.executable, "-m", "deploy", *shlex.split(command)[1:]]
        done = subprocess.run(program, cwd=here, capture_output=True, text=True, timeout=200, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (here / "my_robot.png").stat().st_size > 10_000
