"""A soak and the fault matrix must ask the same of the robot where the same is done to it."""

from __future__ import annotations

import pytest

from deploy.experiments.faults.fault import Reaction
from deploy.experiments.faults.processes import PROCESS_FAULTS
from deploy.experiments.faults.table import FAULTS as MATRIX
from deploy.experiments.soak.faults import FAULTS

MATRIX_NAME = {
    "master-kill": "master killed",
    "slave-kill": "robot's program killed",
    "suit-kill": "CAN bus of the suit off",
    # the process is killed too, and its clock is another when it is back
    "master-clock": "master killed",
    "slave-clock": "robot's program killed",
    "outage": "link cut",
    "router-restart": "link cut",
    "node-loss": "sensor node lost",
}
NOT_THE_ROBOTS = {"recorder-kill", "disk-full"}
"""The recorder only listens: the matrix, which is for who stands at the robot, has no such row."""


def test_every_fault_of_a_soak_has_a_row_or_is_none_of_the_robots() -> None:
    assert MATRIX_NAME.keys() | NOT_THE_ROBOTS == FAULTS.keys()
    assert not any(FAULTS[name].holds for name in NOT_THE_ROBOTS)


@pytest.mark.parametrize(("name", "row"), MATRIX_NAME.items())
def test_a_fault_makes_the_robot_hold_in_a_soak_as_in_the_matrix(name: str, row: str) -> None:
    rows = {fault.name: fault for fault in (*MATRIX, *(one.row for one in PROCESS_FAULTS))}
    assert FAULTS[name].holds is (rows[row].reaction is Reaction.HOLDS)
