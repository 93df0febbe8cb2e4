"""The operator's side starts where there is nothing of what only Linux has."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_master_polls_a_suit_without_what_only_linux_has() -> None:
    """uvloop, fcntl, termios, resource, timerfd, SocketCAN, real-time priorities, SIGHUP are hidden."""
    found = subprocess.run(
        [sys.executable, "-m", "tests.hosts.hidden", "deploy/examples/hand/master.toml", "5"],
        cwd=ROOT, capture_output=True, text=True, timeout=110, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr
    assert "SelectorEventLoop" in found.stdout, "not uvloop's"
    ticks = re.search(r"^ticks (\d+)$", found.stdout, re.MULTILINE)
    assert ticks is not None, found.stdout
    assert int(ticks[1]) > 0, "it polled the suit"
    assert found.stdout.rstrip().endswith("ended in order")
    assert "Traceback" not in found.stderr
