"""A key asks once a press, and only if it was known to be up before."""

from __future__ import annotations

import pytest

from common.inputs.key_state import DOWN, UP, KeyState
from common.inputs.pressed import PressedKey


class Pedal:
    def __init__(self) -> None:
        self.key, self.pressed = KeyState("KEY_B"), PressedKey()

    def look(self) -> bool:
        return self.pressed.take(self.key.down, self.key.presses)


@pytest.fixture
def pedal() -> Pedal:
    pedal = Pedal()
    pedal.key.read(False, 0)
    assert not pedal.look()
    return pedal


def test_each_press_asks_once(pedal: Pedal) -> None:
    for _ in range(2):
        pedal.key.event(DOWN, 0)
        assert [pedal.look(), pedal.look()] == [True, False]
        pedal.key.event(UP, 0)
        assert not pedal.look()


def test_a_press_that_is_over_already_asks_too(pedal: Pedal) -> None:
    pedal.key.event(DOWN, 0)
    pedal.key.event(UP, 0)
    assert [pedal.look(), pedal.look()] == [True, False]


def test_a_key_that_is_down_when_its_device_is_opened_asks_nothing() -> None:
    pedal = Pedal()
    assert not pedal.look()
    pedal.key.read(True, 0)
    assert [pedal.look(), pedal.look()] == [False, False]
    pedal.key.event(UP, 0)
    pedal.look()
    pedal.key.event(DOWN, 0)
    assert pedal.look()


def test_a_device_that_comes_back_with_its_key_down_asks_nothing(pedal: Pedal) -> None:
    pedal.key.lost("unplugged")
    assert not pedal.look()
    pedal.key.read(True, 0)
    assert not pedal.look()
