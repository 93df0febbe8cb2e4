"""Two robots that are not ours, imported as a stranger would, from the suit to the encoders."""

from __future__ import annotations

import pytest

from common.skeleton import load_skeleton
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.table import OF_THE_REACHING_ARM, faults_of
from deploy.harness.faults.virtual import VirtualFault, try_on_virtual_clock
from deploy.measure import accuracy, motion
from deploy.sim.suit.postures import posture_motion
from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.robots.imported import FILES, imported

ROWS = (
    "link cut", "packets duplicated", "second operator", "values that are not numbers", "drive fault",
    "encoder silent", "valid but impossible jump", "yesterday's recording replayed", "stop button",
    "drive moves by itself", "second master at the drives", "encoder stuck", "effort sensor lost",
    "sensor axis stuck", "pedal released", "clutch released and pressed",
)  # fmt: skip
"""Some of those that suit any robot; `tandem faults --profile` tries them all."""

SCENES = BegunScenes()


@pytest.mark.parametrize("file", FILES)
@pytest.mark.long
def test_the_robot_follows_the_operators_postures(file: str) -> None:
    """With calibrated sensors: as well as the nursing robot follows its own motions."""
    profile = str(imported(file))
    run = VirtualWorld(
        WorldSettings(slave_ahead_ns=0, slave_drift_ppm=0.0, one_way_ns=500_000, profile=profile)
    )
    run.engage()
    run.run(posture_motion(load_skeleton(profile)).period_s * 0.6)
    assert run.slave.guard.state == "track", run.slave.guard.reason
    truth, names = run.trace.truth(), run.trace.joint_names
    moved = motion(truth, run.trace.moved(), names)
    assert moved is not None
    assert moved.lag_ms is not None
    assert abs(moved.lag_ms) <= 25.0
    assert len(moved.joints) >= 8
    assert max(joint.rmse_deg for joint in moved.joints.values()) <= 1.0
    solved = accuracy(truth, run.trace.solved(), names).joints
    assert max(joint.rmse_deg for joint in solved.values() if joint is not None) <= 1.0
    assert run.beyond_reach() == {}


@pytest.mark.long
@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("row", ROWS)
def test_a_fault_does_to_it_what_the_table_says(file: str, row: str) -> None:
    fault = faults_of(str(imported(file)))[row]
    assert isinstance(fault, VirtualFault)
    outcome = try_on_virtual_clock(fault, scenes=SCENES)
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("row", ["link cut", "encoder silent"])
def test_the_row_fails_without_its_protection(file: str, row: str) -> None:
    fault = faults_of(str(imported(file)))[row]
    assert isinstance(fault, VirtualFault)
    assert try_on_virtual_clock(fault, fault.held_by).wrong


@pytest.mark.parametrize("row", ["drive fault", "second suit on the bus"])
def test_a_robot_without_a_right_arm_is_tried_without_the_rows_of_that_arm(row: str) -> None:
    table = faults_of("lower_limb")
    assert not OF_THE_REACHING_ARM & table.keys()
    assert faults_of("nursing").keys() >= OF_THE_REACHING_ARM
    fault = table[row]
    assert isinstance(fault, VirtualFault)
    outcome = try_on_virtual_clock(fault)
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"
