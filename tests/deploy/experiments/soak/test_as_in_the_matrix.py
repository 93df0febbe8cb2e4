"""What a soak asks of the robot is a row of the fault table."""

from __future__ import annotations

from deploy.experiments.soak.faults import FAULTS
from deploy.harness.faults.table import FAULTS as ROWS


def test_every_fault_but_the_recorder_s_has_a_row() -> None:
    rows = {name: fault.row for name, fault in FAULTS.items()}
    assert {name for name, row in rows.items() if not row} == {"recorder-kill", "disk-full"}
    assert {row for row in rows.values() if row} <= ROWS.keys()


def test_the_robot_holds_but_where_one_node_is_lost_or_it_is_not_concerned() -> None:
    assert {name for name, fault in FAULTS.items() if not fault.holds} == {
        "recorder-kill", "disk-full", "node-loss",
    }  # fmt: skip
