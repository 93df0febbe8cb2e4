"""Where this kernel has no netem: its tests on one that has, by TANDEM_KERNEL_RUNNER."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys

import pytest

LIMIT_S = 400


@pytest.mark.kernel_can
@pytest.mark.timeout(LIMIT_S + 30)
def test_the_profiles_hold_on_a_kernel_with_netem() -> None:
    runner = os.environ.get("TANDEM_KERNEL_RUNNER")
    if not runner:
        pytest.skip("TANDEM_KERNEL_RUNNER is not set: the command that runs a command on a kernel with netem")
    suite = [sys.executable, "-m", "pytest", "tests/net/test_netem.py", "-v", "--color=no"]
    quiet = ["-p", "no:cacheprovider", f"--timeout={LIMIT_S // 2}"]
    done = subprocess.run(
        [*shlex.split(runner), *suite, *quiet], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    assert re.search(r"::test_\S+ PASSED", done.stdout)
    assert "SKIPPED" not in done.stdout
