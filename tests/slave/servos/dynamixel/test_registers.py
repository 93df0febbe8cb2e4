"""What a servo's bytes say, in words."""

from __future__ import annotations

import pytest

from slave.servos.dynamixel import registers as x


def stretch(torque: int = 1, error: int = 0, watchdog: int = 5) -> bytes:
    out = bytearray(x.HEALTH.size)
    for register, value in ((x.TORQUE, torque), (x.HARDWARE_ERROR, error), (x.BUS_WATCHDOG, watchdog)):
        at = register.address - x.HEALTH.address
        out[at : at + register.size] = register.encode(value)
    return bytes(out)


def test_a_servo_that_is_well_has_nothing_to_say() -> None:
    assert x.health_words(stretch()) == ""
    assert x.health_words(stretch(watchdog=0)) == ""


@pytest.mark.parametrize("bit", range(8))
def test_every_hardware_error_has_words(bit: int) -> None:
    words = x.hardware_words(1 << bit)
    assert words
    # the cause goes before what follows from it
    assert x.health_words(stretch(torque=0, error=1 << bit, watchdog=-1)).startswith(words)


def test_a_stop_by_the_watchdog_and_a_torque_that_is_off() -> None:
    assert "stopped by itself" in x.health_words(stretch(watchdog=-1))
    assert "torque is off" in x.health_words(stretch(torque=0))


def test_a_profile_never_is_unlimited_nor_below_what_was_asked() -> None:
    assert x.profile_velocity(0.0) == 1
    assert x.profile_velocity(1.0) * x.RAD_S_PER_UNIT >= 1.0
    assert (x.profile_velocity(1.0) - 1) * x.RAD_S_PER_UNIT < 1.0
