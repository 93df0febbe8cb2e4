"""Is the key down?"""

from __future__ import annotations

from common.clock import to_ns
from common.inputs.key_state import DOWN, REPEATED, SHORT_S, UP, KeyState

S = to_ns(1.0)


def test_a_key_is_unknown_until_its_device_is_open_and_again_once_it_has_gone() -> None:
    key = KeyState("KEY_B")
    assert key.at(0) is None
    assert key.words
    key.read(True, 0)
    assert key.at(0) is True
    assert key.words == ""
    key.lost("unplugged")
    assert (key.at(0), key.words, key.releases) == (None, "unplugged", 1)


def test_a_key_without_repeats_stays_down_until_it_goes_up() -> None:
    key = KeyState("KEY_B")
    key.event(DOWN, 0)
    assert key.at(3600 * S) is True
    key.event(UP, 3600 * S)
    assert key.at(3600 * S) is False


def test_repeats_are_no_presses() -> None:
    key = KeyState("KEY_B")
    key.read(False, 0)
    key.event(REPEATED, 0)
    assert key.at(0) is False
    assert key.presses == 0


def test_a_device_that_is_to_repeat_and_stops_has_released() -> None:
    key = KeyState("KEY_B", repeat_timeout_s=0.3)
    key.event(DOWN, 0)
    key.event(REPEATED, to_ns(0.25))
    assert key.at(to_ns(0.55)) is True
    assert key.at(to_ns(0.55) + 1) is False
    # neither the device's own word, nor a repeat that comes late, makes it a new press
    key.read(True, S)
    key.event(REPEATED, S)
    assert key.at(S) is False
    key.event(DOWN, 2 * S)
    assert key.at(2 * S) is True


def test_a_release_between_two_looks_is_counted() -> None:
    key = KeyState("KEY_B")
    key.event(DOWN, 0)
    key.event(UP, S)
    key.event(DOWN, S)
    assert (key.at(S), key.releases) == (True, 1)


def test_a_pedal_that_sends_press_and_release_at_once_is_recognised() -> None:
    key = KeyState("KEY_B")
    for begins_ns, lasts_s in ((0, SHORT_S - 1e-6), (S, SHORT_S)):
        key.event(DOWN, begins_ns)
        key.event(UP, begins_ns + to_ns(lasts_s))
    assert (key.presses, key.short_presses) == (2, 1)
