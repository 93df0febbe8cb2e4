"""The processes stay light: what only design-time mathematics needs is not loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("scipy", "matplotlib", "jinja2")
"""scipy alone costs a process some 70 MB."""


@pytest.mark.parametrize(
    ("side", "heavy"),
    [
        ("master.app", (*HEAVY, "mujoco")),
        ("deploy.cli", (*HEAVY, "mujoco", "slave.config")),
        ("slave.app", HEAVY),
    ],
)
def test_a_side_s_process_loads_nothing_heavy(side: str, heavy: tuple[str, ...]) -> None:
    """The slave needs mujoco: it keeps the robot's parts apart, and notices contact by its model.

    `tandem master` starts through the command line: mujoco there cost the master 26 MB.
    """
    look = f"import sys, {side}; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
