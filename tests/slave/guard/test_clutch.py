"""The clutch: the operator repositions, the robot stands; what ends that, and how it goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.wire.messages import Action
from slave.guard import GuardConfig, State
from slave.guard.body import Body

ELBOW = 6


def test_the_robot_stands_soon_and_says_why(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.target + 0.3
    rig.run(0.2)
    assert rig.setpoints[-1].velocity_rad_s.any()
    rig.send(clutch_out=True)
    assert rig.guard.reason.startswith("clutch")
    setpoints = rig.run(0.5, clutch_out=True)
    assert not setpoints[-1].velocity_rad_s.any()
    assert rig.guard.counters.losses == {}


def test_it_goes_on_only_once_it_stands_and_then_slowly(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.target + 0.3
    rig.run(0.2)
    rig.send(clutch_out=True)
    rig.send()
    assert rig.guard.state is State.CLUTCH  # still braking
    rig.run(0.4, clutch_out=True)
    rig.target = rig.target - 1.0
    rig.send()
    assert rig.guard.state is State.ALIGN
    setpoints = rig.run(3.0)
    fastest = max(np.abs(setpoint.velocity_rad_s).max() for setpoint in setpoints)
    assert fastest <= rig.config.align_velocity_rad_s + 1e-9
    assert rig.guard.state is State.TRACK


def test_where_he_went_meanwhile_is_no_target(rig: Any) -> None:
    rig.to(State.CLUTCH)
    rig.target = rig.target + 0.5
    rig.run(0.3, clutch_out=True)
    stood = rig.measured.copy()
    rig.target = stood.copy()
    rig.run(0.5)
    assert rig.guard.state is State.TRACK
    assert np.abs(rig.measured - stood).max() < 1e-9


def sick(rig: Any) -> None:
    rig.body = Body(drives={"neck_yaw": "hot"})
    rig.step()


@pytest.mark.parametrize(
    ("end", "what"),
    [
        (lambda rig: rig.send(clutch_out=True, deadman_held=False), "deadman"),
        (lambda rig: rig.run(0.3, commands=False), "command"),
        (lambda rig: rig.run(0.3, clutch_out=True, valid=np.zeros(rig.joints, np.bool_)), "valid"),
        (sick, "drive"),
        (lambda rig: (rig.encoder_valid.fill(False), rig.run(0.2, clutch_out=True)), "encoder"),
    ],
)
def test_a_loss_meanwhile_is_a_hold_that_needs_an_engage(
    rig: Any, end: Callable[[Any], None], what: str
) -> None:
    rig.to(State.CLUTCH)
    end(rig)
    assert rig.guard.state is State.HOLD
    assert rig.guard.counters.losses == {what: 1}
    rig.body, rig.encoder_valid = Body(), np.ones(rig.joints, np.bool_)
    rig.run(1.0)
    assert rig.guard.state is State.HOLD


@pytest.mark.parametrize("action", [Action.DISENGAGE, Action.RELEASE])
def test_the_operator_may_end_it(rig: Any, action: Action) -> None:
    rig.to(State.CLUTCH)
    assert rig.ask(action).done
    rig.run(0.5)
    assert rig.guard.state is State.HOLD


def test_the_limit_is_kept_to_the_tick(make_rig: Callable[..., Any]) -> None:
    rig = make_rig(GuardConfig(clutch_max_s=1.0)).to(State.CLUTCH)
    began_ns = rig.now_ns
    while rig.guard.state is State.CLUTCH:
        assert rig.now_ns - began_ns <= 1_000_000_000
        rig.run(0.005, clutch_out=True)
    assert rig.now_ns - began_ns == 1_005_000_000
    assert "more than 1 s" in rig.guard.reason


def test_what_forbids_an_engage_forbids_to_go_on(rig: Any) -> None:
    rig.to(State.CLUTCH)
    rig.run(0.2, clutch_out=True)
    rig.send(doubt="waist: leans by 30°")
    assert rig.guard.state is State.HOLD
    assert "leans" in rig.guard.reason


def test_an_engage_meanwhile_is_not_needed_and_does_nothing(rig: Any) -> None:
    rig.to(State.CLUTCH)
    rig.run(0.2, clutch_out=True)
    assert "once the clutch is pressed" in rig.ask(Action.ENGAGE).text
    assert rig.guard.state is State.CLUTCH


def test_a_robot_that_holds_is_not_moved_by_a_clutch(rig: Any) -> None:
    rig.to_leased()
    rig.run(0.2, clutch_out=True)
    rig.run(0.5)
    assert rig.guard.state is State.HOLD


def test_a_late_clutch_after_a_gap_does_not_hide_the_gap(rig: Any) -> None:
    rig.to(State.CLUTCH)
    rig.run(0.2, clutch_out=True)
    rig.now_ns += 250_000_000  # no step, no command
    rig.send()
    assert rig.guard.state is State.HOLD
