"""A controller's state, by its error frames, in words."""

from __future__ import annotations

import pytest

from common.can.controller import Controller, bus_off_words, error_words, of_error_frame


@pytest.mark.parametrize(
    ("error_id", "detail", "state", "words"),
    [
        (0x004, 0x04, Controller.ERROR_WARNING, "the controller is error-warning"),
        (0x004, 0x08, Controller.ERROR_WARNING, "the controller is error-warning"),
        (0x004, 0x10, Controller.ERROR_PASSIVE, "the controller is error-passive"),
        (0x004, 0x2C, Controller.ERROR_PASSIVE, "the controller is error-passive"),
        (0x004, 0x40, Controller.ERROR_ACTIVE, "the controller is error-active"),
        (0x004, 0x01, None, "the controller lost frames that came in"),
        (0x040, 0x00, Controller.BUS_OFF, "the controller is bus-off"),
        (0x100, 0x00, Controller.ERROR_ACTIVE, "the controller was restarted"),
        (0x020, 0x00, None, "no node acknowledges: there is no other node on the bus, or the wire is cut"),
        (0x008, 0x00, None, "frames are destroyed: look at the bit rate, the wiring, 120 Ω at both ends"),
        (0x001, 0x00, None, "error frame 0x1"),
    ],
)
def test_error_frames_in_words(error_id: int, detail: int, state: Controller | None, words: str) -> None:
    data = bytes([0, detail, 0, 0, 0, 0, 0, 0])
    assert of_error_frame(error_id, data) is state
    assert error_words(error_id, data) == words
    counted = bytes([0, detail, 0, 0, 0, 0, 130, 7])
    assert error_words(error_id | 0x200, counted).endswith("130 errors of sending and 7 of receiving counted")
    assert of_error_frame(error_id, b"") in (None, state)


def test_bus_off_says_how_the_controller_comes_back() -> None:
    assert "the kernel restarts it after 100 ms" in bus_off_words("can0", restart_ms=100)
    assert "`ip link set can0 type can restart`" in bus_off_words("can0", restart_ms=0)
