"""What a servo keeps without power (EEPROM): compared at every start, replaced when a person asks for it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.bus import Bus, ServoError
from slave.servos.dynamixel.registers import Register
from slave.servos.dynamixel.settings import Settings

log = logging.getLogger(__name__)

NAMES = {
    x.RETURN_DELAY: "return delay time",
    x.DRIVE_MODE: "drive mode",
    x.OPERATING_MODE: "operating mode",
    x.HOMING_OFFSET: "homing offset",
    x.MAX_POSITION: "max position limit",
    x.MIN_POSITION: "min position limit",
}
"""The names in the maker's manual."""
HOW = "`tandem servos FILE` shows what differs, and with --write replaces it"


@dataclass(frozen=True, slots=True)
class Difference:
    """One register that is not as it must be."""

    register: Register
    found: int
    wanted: int

    @property
    def words(self) -> str:
        """A text such as "operating mode (address 11) is 1, must be 3"."""
        name = NAMES.get(self.register, "register")
        return f"{name} (address {self.register.address}) is {self.found}, must be {self.wanted}"


def differences(bus: Bus, servo: Settings) -> list[Difference]:
    """What a servo keeps and should not; only reads. Raises ServoError."""
    found = [(register, bus.read(servo.id, register), wanted) for register, wanted in servo.lasting]
    return [Difference(register, is_, wanted) for register, is_, wanted in found if is_ != wanted]


def in_words(different: Sequence[Difference]) -> str:
    """All in one line."""
    return ", ".join(difference.words for difference in different)


def replace(bus: Bus, servo: Settings, different: Sequence[Difference]) -> None:
    """Write what must be, and log what was. Raises ServoError, also where the torque is on."""
    if different and bus.read(servo.id, x.TORQUE):
        raise ServoError(support(different))
    for difference in different:
        bus.write(servo.id, difference.register, difference.wanted)
        name = NAMES.get(difference.register, "register")
        log.warning(
            "%s (id %d): %s (address %d) changed permanently from %d to %d",
            servo.joint, servo.id, name, difference.register.address, difference.found, difference.wanted,
        )  # fmt: skip


def support(different: Sequence[Difference]) -> str:
    """Why nothing can be replaced while a servo holds."""
    return (
        f"{in_words(different)}; it can be set only while the torque is off: support the robot, "
        "switch the servos' power off and on"
    )
