"""Tests that send a signal pass wherever the suite runs: also where signals were inherited as ignored."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
SENT = re.compile(r"signal\.SIG(INT|TERM|HUP)\b")
BACKGROUND = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
os.execv(sys.executable, [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *sys.argv[1:]])
"""
SLICE = (
    "common/process/test_runtime.py",
    "deploy/harness/test_spawn.py",
    "deploy/experiments/demo/test_interrupt.py",
    "deploy/test_cli.py::test_ctrl_c_in_a_demo_is_one_line",
    "net/test_hosts.py::test_a_caller_that_is_killed_leaves_nothing_behind",
)


def test_every_file_that_names_a_signal_sets_it_up() -> None:
    files = [file for file in TESTS.rglob("*.py") if file not in (Path(__file__), TESTS / "conftest.py")]
    sending = {str(file.relative_to(TESTS)): file.read_text("utf-8") for file in files}
    sending = {name: text for name, text in sending.items() if SENT.search(text)}
    assert "common/process/test_runtime.py" in sending
    assert [name for name, text in sending.items() if "default_signals" not in text] == []


def test_a_test_that_leaves_a_process_fails_and_the_next_does_not(tmp_path: Path) -> None:
    file = tmp_path / "test_leaves.py"
    file.write_text(
        "import subprocess\n\n\n"
        "def test_leaves():\n    global process\n    process = subprocess.Popen(['sleep', '60'])\n\n\n"
        "def test_next():\n    assert process.wait(5) == -9\n"
    )
    command = ["-q", "-p", "tests.conftest", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(file)]
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", *command],
        cwd=TESTS.parent, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert "2 passed, 1 error" in ended.stdout, ended.stdout + ended.stderr
    assert "left running, now killed: sleep 60" in ended.stdout


@pytest.mark.live
def test_a_slice_of_the_suite_passes_in_the_background_of_a_script() -> None:
    environment = {key: value for key, value in os.environ.items() if key != "CI"}
    ended = subprocess.run(
        [sys.executable, "-c", BACKGROUND, *(str(TESTS / each) for each in SLICE)],
        cwd=TESTS.parent, env=environment, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert re.search(r"\d+ passed", ended.stdout), ended.stdout
