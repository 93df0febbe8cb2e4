"""Who may ask what, and how they are answered."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.wire.messages import Action
from slave.guard import GuardConfig, State

MakeRig = Callable[..., Any]
KEY = "a key kept at the robot"


def test_claim_grants_a_token_once(rig: Any) -> None:
    rig.to_hold()
    first = rig.ask(Action.CLAIM, "anna")
    assert (first.done, first.guard) == (True, State.HOLD)
    assert first.lease > 0
    for who in ("ben", "anna"):
        again = rig.ask(Action.CLAIM, who)
        assert (again.done, again.lease) == (False, 0)
        assert "anna holds the lease" in again.text
    assert rig.guard.operator == "anna"


def test_a_claim_needs_a_name(rig: Any) -> None:
    assert "name" in rig.to_hold().ask(Action.CLAIM, "").text


@pytest.mark.parametrize("state", [State.BOOT, State.ESTOP])
def test_a_claim_changes_no_state(rig: Any, state: State) -> None:
    rig.to(state)
    rig.ask(Action.RELEASE)
    assert rig.claim("ben").done
    assert rig.guard.state is state


def test_a_restarted_master_waits_until_its_own_old_lease_has_lapsed(rig: Any) -> None:
    rig.to_track()
    rig.send()
    rig.run(1.0, commands=False)
    assert not rig.claim().done
    rig.step()
    assert rig.claim().done
    assert rig.guard.state is State.HOLD


@pytest.mark.parametrize("state", [State.ALIGN, State.TRACK])
def test_release_holds_and_frees_the_lease(rig: Any, state: State) -> None:
    rig.to(state)
    assert rig.ask(Action.RELEASE).done
    assert rig.guard.state is State.HOLD
    assert rig.guard.reason == "anna released the lease"
    assert rig.guard.operator == ""
    assert rig.send().gate == "lease"
    assert rig.ask(Action.CLAIM, "ben").done


@pytest.mark.parametrize("state", [State.ALIGN, State.TRACK])
def test_disengage_holds_and_keeps_the_lease(rig: Any, state: State) -> None:
    rig.to(state)
    reply = rig.ask(Action.DISENGAGE)
    assert (reply.done, reply.guard) == (True, State.HOLD)
    assert rig.guard.operator == "anna"
    rig.send()
    rig.engage()


@pytest.mark.parametrize("action", [Action.RELEASE, Action.DISENGAGE, Action.ENGAGE])
@pytest.mark.parametrize("who", ["ben", ""])
def test_only_the_holder_may_release_engage_and_disengage(rig: Any, action: Action, who: str) -> None:
    rig.to_track()
    reply = rig.ask(action, who)
    assert not reply.done
    assert rig.guard.state is State.TRACK
    assert rig.guard.operator == "anna"


@pytest.mark.parametrize("action", [Action.RELEASE, Action.DISENGAGE, Action.ENGAGE])
def test_nobody_is_not_a_holder(rig: Any, action: Action) -> None:
    rig.to_hold()
    assert "claim it first" in rig.ask(action, "").text


@pytest.mark.parametrize("action", sorted(set(Action) - {Action.ESTOP}))
def test_requests_for_another_robot_are_refused(rig: Any, action: Action) -> None:
    rig.to_track()
    reply = rig.ask(action, "anna", key=KEY, robot="robot-2")
    assert (reply.done, reply.guard) == (False, State.TRACK)
    assert "this robot is robot-1, not robot-2" in reply.text


@pytest.mark.parametrize("state", State)
def test_status_tells_why_and_changes_nothing(rig: Any, state: State) -> None:
    rig.to(state)
    reply = rig.ask(Action.STATUS, "")
    assert (reply.done, reply.guard, reply.text, reply.lease) == (True, state, rig.guard.reason, 0)


# reset


@pytest.mark.parametrize("key", ["", KEY[:-1], KEY + " ", KEY.upper(), "kéy", "\ud800"])
def test_a_wrong_key_does_not_reset(rig: Any, key: str) -> None:
    rig.to(State.ESTOP)
    reply = rig.ask(Action.RESET, "anna", key)
    assert (reply.done, reply.guard, reply.text) == (False, State.ESTOP, "wrong reset key")


@pytest.mark.parametrize("key", ["", KEY])
def test_without_a_configured_key_nobody_can_reset(make_rig: MakeRig, key: str) -> None:
    rig = make_rig(GuardConfig()).to(State.ESTOP)
    reply = rig.ask(Action.RESET, "anna", key)
    assert (reply.done, reply.guard) == (False, State.ESTOP)
    assert "no reset key is configured" in reply.text


def test_reset_leads_to_hold_and_never_to_motion(rig: Any) -> None:
    rig.to_track()
    rig.guard.estop(rig.now_ns)
    rig.run(0.5)
    reply = rig.ask(Action.RESET, "porter", KEY)
    assert (reply.done, reply.guard) == (True, State.HOLD)
    before = rig.measured
    rig.target = rig.target + 0.5
    rig.run(1.0)
    assert rig.guard.state is State.HOLD
    assert (rig.measured == before).all()
    rig.engage()


@pytest.mark.parametrize("state", sorted(set(State) - {State.ESTOP}))
def test_there_is_nothing_to_reset_elsewhere(rig: Any, state: State) -> None:
    rig.to(state)
    reply = rig.ask(Action.RESET, "anna", KEY)
    assert (reply.done, reply.guard) == (False, state)
    assert "no e-stop" in reply.text


def test_reset_waits_for_standstill(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    rig.ask(Action.ESTOP)
    rig.step()
    assert rig.ask(Action.RESET, "anna", KEY).text == "still braking"
    rig.run(0.5)
    assert rig.ask(Action.RESET, "anna", KEY).done


def test_reset_waits_for_the_encoders(rig: Any) -> None:
    rig.to(State.ESTOP)
    rig.encoder_valid[2] = False
    rig.run(0.1)
    assert "waist_pitch" in rig.ask(Action.RESET, "anna", KEY).text


def test_an_estop_before_known_encoders_resets_only_with_them(rig: Any) -> None:
    rig.guard.estop(rig.now_ns)
    assert not rig.ask(Action.RESET, "anna", KEY).done
    rig.step()
    assert rig.guard.state is State.ESTOP
    assert rig.ask(Action.RESET, "anna", KEY).done
    assert (rig.step().position_rad == rig.measured).all()


def test_reset_holds_joints_where_a_hand_has_moved_them(rig: Any) -> None:
    rig.to(State.ESTOP)
    rig.coupled = False
    rig.measured = rig.measured.copy()
    rig.measured[6] += 0.5
    before = rig.step()
    assert before.position_rad[6] == pytest.approx(rig.measured[6] - 0.5)
    assert rig.ask(Action.RESET, "anna", KEY).done
    after = rig.step()
    assert (after.position_rad == rig.measured).all()
    assert (after.velocity_rad_s == 0.0).all()


def test_reset_leaves_a_little_sag_alone(rig: Any) -> None:
    rig.to(State.ESTOP)
    rig.coupled = False
    rig.measured = rig.measured - 0.09
    held = rig.step().position_rad
    assert rig.ask(Action.RESET, "anna", KEY).done
    assert (rig.step().position_rad == held).all()


def test_the_key_is_not_shown_with_the_configuration(rig: Any) -> None:
    assert KEY not in repr(rig.config)


@pytest.mark.parametrize("turned_rad", [0.0, -0.02, 0.09, 0.5])
def test_reset_holds_a_joint_whose_drive_tells_its_angle_exactly_there(rig: Any, turned_rad: float) -> None:
    """A drive that is switched on stays where it is: a setpoint elsewhere would make it walk there."""
    rig.drive_off_rad = np.full(rig.joints, 0.01)
    rig.step()
    rig.to(State.HOLD)
    rig.guard.estop(rig.now_ns)
    rig.coupled = False
    rig.measured = rig.measured.copy()
    rig.measured[6] += turned_rad
    rig.run(0.1)
    assert rig.ask(Action.RESET, key=KEY).done
    assert np.array_equal(rig.step().position_rad, rig.measured + 0.01)
    assert rig.guard.state is State.HOLD
