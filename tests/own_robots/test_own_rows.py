"""Rows with a patient, a zone or a posture, with two robots that are not ours; and without their gates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.cli import app
from deploy.experiments.faults.document import matrix
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.own_moves import arms_crossed, hand_to_head
from deploy.harness.faults.table import OF_ONE_ROBOT, faults_of, not_applicable
from deploy.harness.faults.touched import hand, undeclared_kg, wrist
from deploy.harness.faults.virtual import VirtualFault, try_on_virtual_clock
from slave.config import SlaveConfig
from slave.limit.damper import DistanceDamper
from tests.robots.imported import FILES, imported

SCENES = BegunScenes()
LACKING = {"arm_pair.xml": {"hand to own head": "no head"}, "upper_body.urdf": {}}
DAMPED = ("arms crossed", "hand to own head", "hand into a zone", "link cut while a hand comes near a zone")


def row_of(file: str, row: str) -> VirtualFault:
    fault = faults_of(str(imported(file)))[row]
    assert isinstance(fault, VirtualFault)
    return fault


def cases(rows: frozenset[str] | tuple[str, ...] = OF_ONE_ROBOT) -> list[tuple[str, str]]:
    return [(file, row) for file in FILES for row in sorted(rows) if row not in LACKING[file]]


@pytest.mark.parametrize("file", FILES)
def test_a_row_that_does_not_apply_says_what_the_robot_lacks(file: str) -> None:
    profile = str(imported(file))
    assert not_applicable(profile) == LACKING[file]
    assert faults_of(profile).keys() | LACKING[file].keys() == faults_of("nursing").keys()


def test_the_command_and_the_page_tell_what_does_not_apply() -> None:
    profile = str(imported("arm_pair.xml"))
    done = CliRunner().invoke(app, ["faults", "own head", "--profile", profile])
    assert done.exit_code == 0, done.output
    assert "hand to own head: does not apply: no head" in done.output
    assert "| **hand to own head** | does not apply: no head |" in matrix([], not_applicable(profile))


@pytest.mark.long
@pytest.mark.parametrize(("file", "row"), cases())
def test_a_row_of_its_own_does_what_the_table_says(file: str, row: str) -> None:
    outcome = try_on_virtual_clock(row_of(file, row), scenes=SCENES)
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "row"), cases(("contact, slow", "contact, fast", "contact, clamped", "payload wrong"))
)
def test_contact_and_load_go_on_without_the_watch(file: str, row: str) -> None:
    fault = row_of(file, row)
    assert fault.held_by == {"contact"}
    assert try_on_virtual_clock(fault, fault.held_by).wrong


@pytest.mark.long
@pytest.mark.parametrize(("file", "row"), cases(DAMPED))
def test_parts_come_too_near_without_the_damper(file: str, row: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DistanceDamper, "limit", lambda _, step: step.wish_rad_s)
    wrong = try_on_virtual_clock(row_of(file, row)).wrong
    assert [words for words in wrong if "nearer than the margin" in words]


@pytest.mark.parametrize("file", FILES)
def test_the_robot_goes_on_to_a_zone_without_the_watches_of_the_link(file: str) -> None:
    fault = row_of(file, "link cut while a hand comes near a zone")
    assert try_on_virtual_clock(fault, fault.held_by).wrong


@pytest.mark.parametrize("file", FILES)
def test_a_zone_in_the_robot_is_taken_where_nobody_looks(file: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fault = row_of(file, "zone file wrong")
    mistakes = SlaveConfig.mistakes
    monkeypatch.setattr(
        SlaveConfig, "mistakes", lambda self: [m for m in mistakes(self) if "zones" not in m.key]
    )
    assert try_on_virtual_clock(fault).wrong


@pytest.mark.parametrize("file", FILES)
def test_an_operator_who_leans_is_taken_without_the_limit(file: str) -> None:
    fault = row_of(file, "zero pose of somebody who leans")
    master = (*fault.setting.master, "estimation.zero_pose_lean_deg=80.0")
    bared = replace(fault, setting=replace(fault.setting, master=master))
    try:
        wrong = try_on_virtual_clock(bared).wrong
    except TandemError as error:
        wrong = (str(error),)
    assert wrong


def test_where_the_nursing_robot_meets_somebody_is_its_hand_s_joint() -> None:
    nursing = load_skeleton("nursing")
    for part in (hand(nursing), wrist(nursing)):
        assert part is not None
        assert (part.body, part.at_m) == ("right_hand", (0.0, 0.0, 0.0))


def test_a_hand_hangs_on_its_forearm_before_its_own_joints() -> None:
    arm = load_skeleton(str(imported("arm_pair.xml")))
    assert [part and part.body for part in (hand(arm), wrist(arm))] == ["right_arm7", "right_arm6"]


def test_a_robot_without_arms_has_no_part_that_meets_anybody() -> None:
    legs = load_skeleton("lower_limb")
    begin = tuple(legs.zero_rad.tolist())
    assert (hand(legs), wrist(legs), undeclared_kg(legs, begin, 4.0)) == (None, None, None)
    assert (arms_crossed(legs, begin), hand_to_head(legs, begin)) == ("no two arms", "no head")


def test_heavy_arms_are_loaded_more() -> None:
    arm = load_skeleton(str(imported("arm_pair.xml")))
    light = load_skeleton(str(imported("upper_body.urdf")))
    loads = [
        undeclared_kg(robot, tuple(np.clip(robot.zero_rad, robot.lower_rad, robot.upper_rad) + 0.3), 1.0)
        for robot in (arm, light)
    ]
    assert loads[0] is not None
    assert loads[1] is not None
    assert loads[0] > loads[1] >= 1.0
