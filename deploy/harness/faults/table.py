"""The one fault table, in the order of docs/when-something-fails.md, and how a row of it is tried."""

from __future__ import annotations

import asyncio
from dataclasses import replace

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


NURSING_ONLY = frozenset(fault.name for fault in DISTANCE)
"""Rows that name joints of the nursing robot."""


OF_THE_REACHING_ARM = frozenset(
    fault.name for fault in (*SUIT, *SHIFT) if fault.concerns is not None or fault.setting.suit
)
"""Rows that are about the right arm or its node: a robot without one is tried without them."""


def faults_of(profile: str) -> dict[str, FaultRow]:
    """The rows that can be tried with any robot, by name, with the robot of a profile."""
    has_arm = NODE in load_skeleton(profile).segment_names
    left_out = NURSING_ONLY if has_arm else NURSING_ONLY | OF_THE_REACHING_ARM
    return {
        fault.name: replace(
            fault,
            setting=replace(fault.setting, profile=profile),
            otherwise=None if profile == NURSING else OTHERWISE.get(fault.name),
        )
        for fault in VIRTUAL
        if fault.setting.any_robot and fault.name not in left_out
    }


_SCENES = BegunScenes()


def try_fault(fault: FaultRow) -> FaultOutcome:
    """Bring the fault about and judge the robot. Raises TandemError where the trial cannot begin."""
    if isinstance(fault, ProcessFault):
        return asyncio.run(try_with_processes(fault))
    assert isinstance(fault, VirtualFault)
    return try_on_virtual_clock(fault, scenes=_SCENES)
