"""`.ci/tests` fails where a part failed; a second try, alone, saves only tests that failed beside others."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent.parent / ".ci" / "tests"
PART = """#!/bin/sh
case "$*" in
  *--last-failed*) part=again ;;
  *"not live"*) part=pure ;;
  *) part=live ;;
esac
[ "${0##*/}" = mypy ] && part=types
echo "$part" >> ran
eval "exit \\"\\${status_$part:-0}\\""
"""
"""Stands for mypy and for python: ends with the status that its part's variable says."""

pytestmark = pytest.mark.skipif(shutil.which("setsid") is None, reason="no setsid: .ci/tests is for Linux")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / ".ci").mkdir()
    shutil.copy(SCRIPT, tmp_path / ".ci" / "tests")
    bins = tmp_path / ".venv" / "bin"
    bins.mkdir(parents=True)
    for name in ("mypy", "python"):
        (bins / name).write_text(PART)
        (bins / name).chmod(0o755)
    return tmp_path


@pytest.mark.parametrize(
    ("statuses", "passes", "again"),
    [
        ({}, True, 0),
        ({"types": "1"}, False, 0),
        ({"pure": "1", "types": "1"}, False, 1),
        *(({part: "1"}, True, 1) for part in ("live", "pure")),
        *(({part: "1", "again": "1"}, False, 1) for part in ("live", "pure")),
        *(({part: "1", "again": "5"}, False, 1) for part in ("live", "pure")),
        ({"pure": "1", "live": "1"}, True, 2),
        ({"pure": "1", "live": "1", "again": "1"}, False, 2),
        # stopped by -x or Ctrl-C, an error of pytest's own, no test found, too many skipped
        *(({part: status}, False, 0) for part in ("live", "pure") for status in ("2", "3", "4", "5", "10")),
    ],
)
def test_each_part_that_fails_fails_all(
    checkout: Path, statuses: dict[str, str], passes: bool, again: int
) -> None:
    environment = os.environ | {f"status_{part}": status for part, status in statuses.items()}
    ended = subprocess.run(
        ["bash", ".ci/tests"],
        cwd=checkout, env=environment, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    ran = (checkout / "ran").read_text().split()
    assert (ended.returncode == 0) == passes, ended.stdout + ended.stderr
    assert sorted(ran) == sorted(["live", "pure", "types", *["again"] * again])
