"""The robots that are not ours, imported once a session as a person would."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from typer.testing import CliRunner

from deploy.cli import app

ROBOTS = Path(__file__).parent
FILES = ("arm_pair.xml", "upper_body.urdf")
_KEPT: list[tempfile.TemporaryDirectory[str]] = []


@cache
def imported(file: str) -> Path:
    """The folder of its profile; it lives as long as the tests' process."""
    _KEPT.append(tempfile.TemporaryDirectory(prefix="tandem-own-"))
    out = Path(_KEPT[-1].name) / Path(file).stem
    done = CliRunner().invoke(app, ["profile", "import", str(ROBOTS / file), "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out
