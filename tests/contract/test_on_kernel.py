"""Where this kernel has no SocketCAN: the same contract on one that has, by TANDEM_KERNEL_RUNNER."""

from __future__ import annotations

import os
import re
import shlex
import socket
import subprocess
import sys

import pytest

LIMIT_S = 400
ONLY_SKIP = ("test_an_error_frame_is_counted_and_not_handed_on", "socketcan-kvaser-classic")
"""No error frame crosses a wire."""


@pytest.mark.kernel_can
@pytest.mark.timeout(LIMIT_S + 30)
def test_the_contract_holds_on_a_kernel_with_socketcan() -> None:
    runner = os.environ.get("TANDEM_KERNEL_RUNNER")
    if _kernel_has_can():
        pytest.skip("this kernel has SocketCAN: the suite itself has run on it")
    if not runner:
        pytest.skip(
            "TANDEM_KERNEL_RUNNER is not set: the command that runs a command on a kernel with SocketCAN"
        )
    suite = [sys.executable, "-m", "pytest", "tests/contract/test_suit_bus.py", "-k", "socketcan"]
    quiet = ["-p", "no:cacheprovider", "-v", "--color=no", "--timeout=120"]
    done = subprocess.run(
        [*shlex.split(runner), *suite, *quiet], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    passed, skipped = ends(done.stdout, "PASSED"), ends(done.stdout, "SKIPPED")
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    wires = {wire for _, wire in passed}
    assert wires == {"socketcan-vcan-fd", "socketcan-vcan-classic", "socketcan-kvaser-classic"}
    tests = {test for test, _ in passed}
    assert skipped == {ONLY_SKIP}, done.stdout[-5000:]
    assert len(passed | skipped) == len(tests) * len(wires)


def ends(said: str, outcome: str) -> set[tuple[str, str]]:
    """Test and wire of each that ended so."""
    return set(re.findall(rf"::(\w+)\[(socketcan[\w-]+)\] {outcome}", said))


def _kernel_has_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True
