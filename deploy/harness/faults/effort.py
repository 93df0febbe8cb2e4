"""Faults of what drives tell of their effort."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deploy.harness.faults.scene import Scene
from deploy.harness.faults.virtual import VirtualFault, goes_on
from slave.servos.servos import EncoderReading

JOINT = "left_elbow_pitch"
"""Its motor works against gravity in the trial. Of another robot: its first joint."""


def _effort_lost(scene: Scene) -> None:
    names = scene.skeleton.joint_names
    joint = names.index(JOINT) if JOINT in names else 0

    def read(reading: EncoderReading) -> EncoderReading:
        assert reading.effort_nm is not None
        effort_nm = reading.effort_nm.copy()
        effort_nm[joint] = np.nan
        return replace(reading, effort_nm=effort_nm)

    def told() -> None:
        state = scene.run.states[-1]
        unknown = [] if state.effort_nm is None else np.flatnonzero(np.isnan(state.effort_nm)).tolist()
        if state.encoder_ns > begun_ns and unknown != [joint]:
            scene.granted.append("a state in which not just the silent drive's effort is unknown")

    begun_ns = scene.run.slave_ns
    scene.inject.read, scene.each_period = read, told


EFFORT: tuple[VirtualFault, ...] = (
    goes_on(
        name="effort sensor lost",
        done="The drive of one elbow stops telling its torque.",
        robot="Follows. The state no longer has that joint's effort, `tandem status` names the joint, and no "
        "contact is noticed there.",
        person="Let the drive be repaired; until then nobody stands within that arm's reach.",
        act=_effort_lost,
        strays_deg=0.1,
    ),
)
