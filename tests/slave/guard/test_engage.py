"""Each condition of `engage`: refused in words with it, granted without it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.wire.messages import Action
from slave.guard import State, engage
from slave.guard.body import Body

MakeRig = Callable[..., Any]


def in_estop(rig: Any) -> None:
    rig.to_leased().guard.estop(rig.now_ns)
    rig.send()


def stranger(rig: Any) -> None:
    rig.to_leased().ask(Action.RELEASE)
    assert rig.claim("ben").done
    rig.run(0.1)


def nobody(rig: Any) -> None:
    rig.to_leased().ask(Action.RELEASE)


def silent_master(rig: Any) -> None:
    rig.to_leased().run(0.25, commands=False)


def all_nodes_lost(rig: Any) -> None:
    rig.to_leased().run(0.1, valid=np.zeros(rig.joints, np.bool_))


def operator_side_refuses(rig: Any) -> None:
    rig.to_leased().run(0.1, doubt="waist: turned at 30°/s in the zero pose")


def encoder_lost(rig: Any) -> None:
    rig.to_leased()
    rig.encoder_valid[6] = False
    rig.run(0.1)


def drive_faulty(rig: Any) -> None:
    rig.to_leased()
    rig.body = Body(drives={"left_elbow_pitch": "over-current"})
    rig.run(0.1)


def encoder_doubted(rig: Any) -> None:
    rig.to_track()
    rig.coupled = False
    rig.measured = rig.measured.copy()
    rig.measured[6] += 0.15
    rig.run(0.3)
    rig.ask(Action.DISENGAGE)
    rig.measured = rig.setpoints[-1].position_rad.copy()
    rig.run(0.1)


def clutch_out(rig: Any) -> None:
    rig.to_leased()
    rig.run(0.1, clutch_out=True)


def still_moving(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    rig.ask(Action.DISENGAGE)
    rig.send()


def moved_by_hand(rig: Any) -> None:
    rig.to_leased()
    rig.coupled = False
    rig.measured = rig.measured.copy()
    rig.measured[6] += rig.config.engage_window_rad + 1e-9
    rig.run(0.1)


CASES: list[tuple[Callable[..., Any], Callable[[Any], None], str]] = [
    (engage._state, in_estop, "reset it first"),
    (engage._holder, stranger, "ben holds the lease"),
    (engage._command, silent_master, "no command for"),
    (engage._operator_side, operator_side_refuses, "waist: turned at 30°/s in the zero pose"),
    (engage._clutch, clutch_out, "the clutch is released"),
    (engage._valid, all_nodes_lost, "no joint of the last command is valid"),
    (engage._encoder, encoder_lost, "left_elbow_pitch"),
    (engage._body, drive_faulty, "the drive of left_elbow_pitch: over-current"),
    (engage._unsettled, encoder_doubted, "left_elbow_pitch: the encoder is"),
    (engage._rest, still_moving, "still braking"),
    (engage._strayed, moved_by_hand, "left_elbow_pitch is 0.10 rad from where it is held"),
]


@pytest.mark.parametrize(("condition", "scene", "words"), CASES)
def test_refused_in_words(rig: Any, condition: Any, scene: Callable[[Any], None], words: str) -> None:
    scene(rig)
    before = rig.guard.state
    reply = rig.ask(Action.ENGAGE)
    assert not reply.done
    assert words in reply.text
    assert rig.guard.state is before


@pytest.mark.parametrize(("condition", "scene", "words"), CASES[1:])
def test_without_its_condition_it_would_move(
    rig: Any, condition: Any, scene: Callable[[Any], None], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene(rig)
    monkeypatch.setattr(engage, "CONDITIONS", tuple(c for c in engage.CONDITIONS if c is not condition))
    assert rig.ask(Action.ENGAGE).done
    assert rig.guard.state is State.ALIGN


def test_every_condition_has_a_case() -> None:
    assert [case[0] for case in CASES] == list(engage.CONDITIONS)


def test_a_doubt_that_the_operator_side_took_back_refuses_nothing(rig: Any) -> None:
    operator_side_refuses(rig)
    rig.run(0.1)
    assert rig.ask(Action.ENGAGE).done


def test_refused_before_the_encoders_are_known(rig: Any) -> None:
    rig.claim()
    rig.send()
    reply = rig.ask(Action.ENGAGE)
    assert (reply.done, reply.guard) == (False, State.BOOT)
    assert "every encoder" in reply.text


def test_refused_where_nobody_holds_the_lease(rig: Any) -> None:
    nobody(rig)
    assert "claim it first" in rig.ask(Action.ENGAGE).text


@pytest.mark.parametrize("state", [State.ALIGN, State.TRACK])
def test_refused_while_it_moves_already(rig: Any, state: State) -> None:
    rig.to(state)
    assert f"already in {state}" in rig.ask(Action.ENGAGE).text
    assert rig.guard.state is state


def test_a_command_from_before_the_loss_does_not_count(rig: Any) -> None:
    rig.to_track()
    rig.send()
    rig.ask(Action.DISENGAGE)
    assert "no command" in rig.ask(Action.ENGAGE).text
    rig.send()
    assert rig.ask(Action.ENGAGE).done


def test_a_command_from_an_earlier_lease_does_not_count(rig: Any) -> None:
    rig.to_leased()
    rig.send()
    rig.ask(Action.RELEASE)
    rig.claim()
    assert "no command" in rig.ask(Action.ENGAGE).text


def test_where_it_sags_within_the_window_it_engages(rig: Any) -> None:
    rig.to_leased()
    rig.coupled = False
    rig.measured = rig.measured - rig.config.engage_window_rad * 0.999
    rig.run(0.1)
    rig.engage()
