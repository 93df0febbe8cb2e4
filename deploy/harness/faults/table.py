"""The one fault table, in the order of docs/when-something-fails.md, and how a row of it is tried."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import cache

from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.camera import CAMERA
from deploy.harness.faults.clocks import CLOCKS, ESTOPS
from deploy.harness.faults.contact import CONTACT
from deploy.harness.faults.deadman import DEADMAN
from deploy.harness.faults.distance import DISTANCE
from deploy.harness.faults.effort import EFFORT
from deploy.harness.faults.fault import FaultRow
from deploy.harness.faults.judge import FaultOutcome
from deploy.harness.faults.link import LINK
from deploy.harness.faults.operators import OPERATORS
from deploy.harness.faults.own_rows import own_rows
from deploy.harness.faults.processes import PROCESSES, ProcessFault, try_with_processes
from deploy.harness.faults.robot import OTHERWISE, ROBOT
from deploy.harness.faults.shift import SHIFT
from deploy.harness.faults.slow_link import SLOW_LINK
from deploy.harness.faults.stop_inputs import STOP_INPUTS
from deploy.harness.faults.strangers import STRANGERS
from deploy.harness.faults.suit import NODE, SUIT
from deploy.harness.faults.values import VALUES
from deploy.harness.faults.virtual import VirtualFault, try_on_virtual_clock

VIRTUAL: tuple[VirtualFault, ...] = (
    *LINK,
    *SLOW_LINK,
    *STRANGERS,
    *OPERATORS,
    *VALUES,
    *SUIT,
    *SHIFT,
    *DISTANCE,
    *ROBOT,
    *EFFORT,
    *CONTACT,
    *CAMERA,
    *CLOCKS,
    *ESTOPS,
    *STOP_INPUTS,
    *DEADMAN,
)
FAULTS: dict[str, FaultRow] = {fault.name: fault for fault in (*VIRTUAL, *PROCESSES)}
"""Every fault, by name."""


OF_ONE_ROBOT = frozenset(fault.name for fault in VIRTUAL if fault in DISTANCE or not fault.setting.any_robot)
"""Rows with a patient, a zone, a posture: another robot has its own (`own_rows.py`)."""


OF_THE_REACHING_ARM = frozenset(
    fault.name for fault in (*SUIT, *SHIFT) if fault.concerns is not None or fault.setting.suit
)
"""Rows that are about the right arm or its node: they do not apply to a robot without one."""


def faults_of(profile: str) -> dict[str, FaultRow]:
    """The rows that are tried with the robot of a profile on the virtual clock, by name."""
    return {name: row for name, row in _rows_of(profile).items() if not isinstance(row, str)}


def not_applicable(profile: str) -> dict[str, str]:
    """The rows that do not apply to the robot of a profile, each with what the robot lacks."""
    return {name: row for name, row in _rows_of(profile).items() if isinstance(row, str)}


@cache
def _rows_of(profile: str) -> dict[str, VirtualFault | str]:
    if profile == NURSING:
        return {fault.name: fault for fault in VIRTUAL}
    of_robot = list(own_rows(profile))
    own = {row[0]: row[1] for row in of_robot if isinstance(row, tuple)}
    found = {row.name: row for row in of_robot if isinstance(row, VirtualFault)}
    has_arm = NODE in load_skeleton(profile).segment_names
    rows: dict[str, VirtualFault | str] = {}
    for fault in VIRTUAL:
        if fault.name in own:
            rows[fault.name] = own[fault.name]
        elif not has_arm and fault.name in OF_THE_REACHING_ARM:
            rows[fault.name] = "no right forearm"
        elif fault.name in found or fault.name not in OF_ONE_ROBOT:
            row = found.get(fault.name, fault)
            rows[fault.name] = replace(
                row,
                setting=replace(row.setting, profile=profile),
                otherwise=OTHERWISE.get(fault.name),
            )
    return rows


_SCENES = BegunScenes()


def try_fault(fault: FaultRow) -> FaultOutcome:
    """Bring the fault about and judge the robot. Raises TandemError where the trial cannot begin."""
    if isinstance(fault, ProcessFault):
        return asyncio.run(try_with_processes(fault))
    assert isinstance(fault, VirtualFault)
    return try_on_virtual_clock(fault, scenes=_SCENES)
