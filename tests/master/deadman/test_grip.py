"""What a command says of the operator's hold, and when it is told."""

from __future__ import annotations

from common.inputs.key_state import DOWN, UP, KeyState
from master.deadman.grip import Grip, OperatorGrip

HELD, RELEASED = Grip(True), Grip(False)


def pedal() -> KeyState:
    key = KeyState("KEY_B")
    key.read(False, 0)
    return key


def held() -> tuple[KeyState, OperatorGrip]:
    key = pedal()
    grip = OperatorGrip(key)
    assert grip.take(0) == RELEASED
    key.event(DOWN, 0)
    assert grip.take(0) == HELD
    return key, grip


def test_without_a_pedal_it_is_always_held() -> None:
    grip = OperatorGrip(None)
    assert grip.take(0) == HELD
    assert grip.ended(0) is None
    assert grip.words == {"deadman": "always held"}


def test_a_release_is_told_at_once_and_once() -> None:
    key, grip = held()
    assert grip.ended(0) is None
    key.event(UP, 0)
    assert grip.ended(0) == RELEASED
    assert grip.ended(0) is None
    assert grip.take(0) == RELEASED
    assert grip.words == {"deadman": "released"}


def test_a_press_waits_for_the_next_command() -> None:
    key = pedal()
    grip = OperatorGrip(key)
    grip.take(0)
    key.event(DOWN, 0)
    assert grip.ended(0) is None
    assert grip.take(0) == HELD


def test_a_release_between_two_commands_is_in_one_of_them() -> None:
    key, grip = held()
    key.event(UP, 0)
    key.event(DOWN, 0)
    assert grip.take(0) == RELEASED
    assert grip.take(0) == HELD


def test_a_contact_that_chatters_is_told_once_a_command() -> None:
    key, grip = held()
    told = 0
    for _ in range(100):
        key.event(UP, 0)
        key.event(DOWN, 0)
        told += grip.ended(0) is not None
    assert told == 1


def test_a_pedal_that_has_gone_is_released_and_says_why() -> None:
    key, grip = held()
    key.lost("/dev/input/event5 has gone")
    assert grip.ended(0) == RELEASED
    assert grip.words == {"deadman": "/dev/input/event5 has gone"}
    key.read(True, 0)  # plugged in again under the foot
    assert grip.take(0) == RELEASED
    assert "pressed already" in grip.words["deadman"]


def test_a_clutch_that_is_released_is_told_at_once_and_does_not_release_the_deadman() -> None:
    key, clutch = pedal(), pedal()
    grip = OperatorGrip(key, clutch)
    assert grip.take(0) == Grip(False, clutch_out=True)
    key.event(DOWN, 0)
    clutch.event(DOWN, 0)
    assert grip.take(0) == HELD
    clutch.event(UP, 0)
    assert grip.ended(0) == Grip(True, clutch_out=True)
    assert grip.ended(0) is None
    key.event(UP, 0)
    assert grip.ended(0) == Grip(False, clutch_out=True)
