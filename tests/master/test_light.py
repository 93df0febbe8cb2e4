"""The master's process stays light: what only design-time mathematics needs is not loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("scipy", "matplotlib", "mujoco", "jinja2")
"""scipy alone costs a process some 70 MB."""


@pytest.mark.parametrize("side", ["master.app", "slave.app"])
def test_a_side_s_process_loads_nothing_heavy(side: str) -> None:
    look = f"import sys, {side}; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
