"""The rows that need real processes: what the drives' own buses show when a program is killed or stopped."""

from __future__ import annotations

import asyncio

import pytest

from deploy.harness.faults.processes import PROCESSES, ProcessFault, try_with_processes

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


@pytest.mark.parametrize("fault", PROCESSES, ids=lambda fault: fault.name)
def test_the_robot_stands_whatever_program_dies(fault: ProcessFault) -> None:
    outcome = asyncio.run(try_with_processes(fault))
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"
