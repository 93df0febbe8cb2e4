"""`tandem-console` is the console, without what the other commands load."""

from __future__ import annotations

import json
import subprocess
import sys

from typer.testing import CliRunner

from deploy import console_alone

LOADED = """
import json, sys
import deploy.console_alone, deploy.console.options, deploy.console.run
print(json.dumps(sorted(sys.modules)))
"""
HEAVY = {"scipy", "mujoco", "matplotlib", "pandas", "pyarrow", "av", "deploy.cli", "deploy.experiments"}


def test_it_loads_nothing_that_a_console_has_no_use_for() -> None:
    """Some 25 MB for the other commands, 20 MB for scipy: a console runs beside a master for days."""
    said = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True).stdout
    assert HEAVY & set(json.loads(said)) == set()


def test_it_takes_the_options_of_the_command_and_says_what_is_wrong_in_one_line() -> None:
    shown = CliRunner().invoke(console_alone.app, ["--help"])
    assert shown.exit_code == 0
    assert "--master" in shown.output
    wrong = subprocess.run(
        [sys.executable, "-m", "deploy.console_alone"], capture_output=True, text=True, check=False
    )
    assert wrong.returncode == 1
    assert "where is the robot?" in wrong.stderr
    assert len(wrong.stderr.strip().splitlines()) == 1
