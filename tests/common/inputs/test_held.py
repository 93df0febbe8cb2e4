"""What counts as held by a person."""

from __future__ import annotations

from common.inputs.held import HeldSwitch


def test_a_press_counts_after_a_release() -> None:
    switch = HeldSwitch()
    assert not switch.take(False)
    assert switch.words == "released"
    assert switch.take(True)
    assert switch.words == ""
    assert not switch.take(False)


def test_a_switch_that_is_down_from_the_start_is_not_held() -> None:
    switch = HeldSwitch()
    assert not switch.take(True)
    assert not switch.take(True)
    assert "pressed already" in switch.words
    switch.take(False)
    assert switch.take(True)


def test_a_switch_that_was_away_must_be_released_first() -> None:
    switch = HeldSwitch()
    switch.take(False)
    assert switch.take(True)
    assert not switch.take(None, words="unplugged")
    assert switch.words == "unplugged"
    assert not switch.take(True)


def test_a_release_between_two_looks_is_seen_by_one_of_them() -> None:
    switch = HeldSwitch()
    switch.take(False, releases=3)
    assert switch.take(True, releases=3)
    assert not switch.take(True, releases=4)
    assert switch.words == "released"
    assert switch.take(True, releases=4)


def test_a_switch_that_was_released_and_pressed_between_two_looks_may_be_held() -> None:
    switch = HeldSwitch()
    assert not switch.take(True)
    assert not switch.take(True, releases=1)
    assert switch.take(True, releases=1)


def test_a_switch_that_left_while_it_was_down_is_not_armed_by_that() -> None:
    switch = HeldSwitch()
    switch.take(False)
    assert switch.take(True)
    assert not switch.take(None, releases=1)
    assert not switch.take(True, releases=1)
    assert "pressed already" in switch.words
