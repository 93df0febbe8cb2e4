"""The rows that need real processes: what the drives' own buses show when a program is killed or stopped."""

from __future__ import annotations

import asyncio

import pytest

from deploy.experiments.faults.processes import PROCESS_FAULTS, ProcessFault, tried

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


@pytest.mark.parametrize("fault", PROCESS_FAULTS, ids=lambda fault: fault.row.name)
def test_the_robot_stands_whatever_program_dies(fault: ProcessFault) -> None:
    outcome = asyncio.run(tried(fault))
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"
