"""Every row of the fault matrix, and that it fails once what holds the fault off is taken away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import slave.limit.limit
from common.errors import TandemError
from common.inputs.held import HeldSwitch
from common.inputs.key_state import KeyState
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.fault import Reaction
from deploy.harness.faults.table import FAULTS as EVERY
from deploy.harness.faults.table import VIRTUAL as FAULTS
from deploy.harness.faults.virtual import try_on_virtual_clock
from master.deadman import can_button
from master.deadman.can_button import CanButtonState
from master.deadman.grip import OperatorGrip
from slave.encoders.agreement import EncoderAgreement
from slave.encoders.uncommanded import UncommandedMotion
from slave.guard import GATES, Guard, states
from slave.guard.body import Body
from slave.guard.states import GuardEvent
from slave.guard.watchdog import ARRIVAL_WATCHES, BODY_WATCHES
from slave.stop_inputs.rule import StopInput

TABLE = {fault.name: fault for fault in FAULTS}
BARED = (
    "link cut", "packets duplicated", "yesterday's recording replayed", "second operator", "wrong robot",
    "operator of the same robot without the lease", "certificate revoked while tracking",
    "values that are not numbers", "drive fault", "encoder silent", "base tilted",
    "master's clock an hour back", "camera gives no picture any more", "pedal released",
    "link lost while the clutch is released",
)  # fmt: skip
"""Of the rows with a protection to take away; more would say no more, and each takes a second."""
SCENES = BegunScenes()
"""Not for a test that patches something: what it patches may be at work before the fault."""
RULES = {str(rule) for rule, _ in slave.limit.limit.RULES}


LONG = {"iron at a magnetometer while it is worn", "gyro with a gross bias"}
"""Rows of more than 3 s."""


def rows() -> Iterator[object]:
    """All, those that the table itself says are missed as expected failures."""
    for f in FAULTS:
        marks = [pytest.mark.long] * (f.name in LONG)
        if f.missed:
            marks.append(pytest.mark.xfail(strict=True, reason=f.missed))
        yield pytest.param(f.name, marks=marks, id=f.name)


@pytest.mark.parametrize("name", list(rows()))
def test_the_robot_does_what_the_table_says(name: str) -> None:
    outcome = try_on_virtual_clock(TABLE[name], scenes=SCENES)
    assert not outcome.wrong, f"{outcome.state}: {outcome.reason}"


@pytest.mark.parametrize("name", BARED)
def test_the_row_fails_without_its_protection(name: str) -> None:
    fault = TABLE[name]
    assert fault.held_by
    assert try_on_virtual_clock(fault, fault.held_by).wrong


def test_the_rules_of_the_limiter_are_what_bounds_a_jump(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = TABLE["valid but impossible jump"]
    assert not [word for word in try_on_virtual_clock(fault).wrong if "setpoint" in word]
    kept = tuple(pair for pair in slave.limit.limit.RULES if str(pair[0]) not in fault.held_by)
    monkeypatch.setattr(slave.limit.limit, "RULES", kept)
    assert [word for word in try_on_virtual_clock(fault).wrong if "setpoint" in word]


def test_a_drive_that_moves_by_itself_goes_on_without_the_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        UncommandedMotion, "judge", lambda self, *_, **__: np.zeros(len(self._names), np.bool_)
    )
    assert try_on_virtual_clock(TABLE["drive moves by itself"]).wrong


def test_drives_that_differ_from_encoders_go_on_without_the_comparison(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(EncoderAgreement, "judge", lambda *_: None)
    assert try_on_virtual_clock(TABLE["drive and output encoder differ"]).wrong


@pytest.mark.parametrize(
    ("name", "owner", "part", "by"),
    [
        ("stop button", Body, "estop", None),
        ("stop button", Guard, "still_pressed", lambda _: None),
        ("stop button tapped", StopInput, "_open", lambda *_: ""),
        ("stop wire broken", StopInput, "step", lambda self, *a: StopInput._open(self, *a)),
        ("stop input unplugged", StopInput, "_open", lambda _, now_ns, level, awake: level.on is False),
        ("stop input silent", StopInput, "_open", lambda _, now_ns, level, awake: level.on is not True),
    ],
)
def test_a_stop_input_s_row_fails_without_what_holds_it(
    monkeypatch: pytest.MonkeyPatch, name: str, owner: type, part: str, by: object
) -> None:
    monkeypatch.setattr(owner, part, by)
    assert try_on_virtual_clock(TABLE[name]).wrong


@pytest.mark.parametrize(
    ("name", "owner", "part", "by"),
    [
        ("pedal released", OperatorGrip, "ended", lambda *_: None),
        ("pedal released for a moment", HeldSwitch, "take", lambda _, down, *__: bool(down)),
        ("pedal unplugged", KeyState, "lost", lambda *_: None),
        ("pedal stuck from the start", HeldSwitch, "take", lambda _, down, *__: bool(down)),
        ("clutch released", Guard, "_clutch", lambda *_: None),
        ("bus of the deadman's button off", CanButtonState, "bus_down", lambda *_: None),
        ("node of the deadman's button frozen", can_button, "COUNTER", "no such signal"),
    ],
)
def test_an_operator_s_row_fails_without_what_holds_it(
    monkeypatch: pytest.MonkeyPatch, name: str, owner: object, part: str, by: object
) -> None:
    monkeypatch.setattr(owner, part, by)
    assert try_on_virtual_clock(TABLE[name]).wrong


@pytest.mark.parametrize(
    ("name", "without"),
    [
        ("zero pose of somebody who leans", "estimation.zero_pose_lean_deg=80.0"),
        ("gyro with a gross bias", "estimation.vqf.rest_bias=false"),
        pytest.param(
            "iron at a magnetometer while it is worn",
            "estimation.vqf.field_change=0.0",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_row_of_the_estimate_fails_without_its_setting(name: str, without: str) -> None:
    fault = TABLE[name]
    bared = replace(fault, setting=replace(fault.setting, master=(*fault.setting.master, without)))
    try:
        wrong = try_on_virtual_clock(bared).wrong
    except TandemError as error:
        wrong = (str(error),)
    assert wrong


def test_an_emergency_stop_fails_without_its_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = TABLE["emergency stop in track"]
    # a table without it, not the table itself: put back, it would stand at another place
    rest = {
        pair: after for pair, after in states.TRANSITIONS.items() if pair != (fault.begins, GuardEvent.ESTOP)
    }
    monkeypatch.setattr(states, "TRANSITIONS", rest)
    assert try_on_virtual_clock(fault).wrong


def test_the_table_names_only_protections_there_are() -> None:
    known = {gate.name for gate in GATES} | {w.name for w in (*ARRIVAL_WATCHES, *BODY_WATCHES)} | RULES
    assert set().union(*(fault.held_by for fault in FAULTS)) <= known
    assert set().union(*(fault.refused_by for fault in FAULTS)) <= known | {"codec"}


def test_every_row_that_stands_has_a_bound() -> None:
    assert len(TABLE) == len(FAULTS), "two rows of one name"
    for fault in EVERY.values():
        stands = fault.reaction not in (Reaction.GOES_ON, Reaction.LIMITED)
        assert (fault.stands_s is not None) == stands, fault.name
        assert stands or fault.strays_deg is not None or fault.reaction is Reaction.LIMITED, fault.name
