"""The part of the X series' control table that is used here, as its manual has it.

ROBOTIS e-Manual, for example XM430-W350 and XM540-W150: "Control Table".
"""

from __future__ import annotations

from dataclasses import dataclass

from common.quaternion import Array


@dataclass(frozen=True, slots=True)
class Register:
    """Where a value lies: little-endian, `size` bytes."""

    address: int
    size: int
    signed: bool = False

    def encode(self, value: int) -> bytes:
        """Raises OverflowError where it does not fit."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """The value of `size` bytes."""
        return int.from_bytes(data, "little", signed=self.signed)


MODEL = Register(0, 2)
FIRMWARE = Register(6, 1)
RETURN_DELAY = Register(9, 1)
"""In 2 µs."""
DRIVE_MODE = Register(10, 1)
OPERATING_MODE = Register(11, 1)
HOMING_OFFSET = Register(20, 4, signed=True)
MAX_POSITION = Register(48, 4)
MIN_POSITION = Register(52, 4)
TORQUE = Register(64, 1)
STATUS_RETURN = Register(68, 1)
HARDWARE_ERROR = Register(70, 1)
BUS_WATCHDOG = Register(98, 1, signed=True)
"""In 20 ms; 0 off; -1 it has stopped the servo, and goals are refused until it is set to 0."""
PROFILE_ACCELERATION = Register(108, 4)
PROFILE_VELOCITY = Register(112, 4)
GOAL_POSITION = Register(116, 4, signed=True)
PRESENT_POSITION = Register(132, 4, signed=True)
PRESENT = Register(126, 10)
"""One stretch from the present current (of some models the load), signed 16 bits, to PRESENT_POSITION."""
HEALTH = Register(64, 35)
"""One stretch with TORQUE, HARDWARE_ERROR and BUS_WATCHDOG."""
PLACE = Register(97, 39)
"""A stretch that ends with PRESENT_POSITION. It is longer than any other that is read: an answer tells its
length but not its address, so that a late answer to another read can never be taken for where a servo stands.
"""

POSITION_MODE = 3
ANSWER_ALL = 2
WATCHDOG_TRIPPED = -1
WATCHDOG_FIRMWARE = 38
"""The oldest firmware that has a bus watchdog."""
RAD_S_PER_UNIT = 0.229 * 2.0 * 3.141592653589793 / 60.0
"""The unit of PROFILE_VELOCITY: 0.229 revolutions a minute."""

_X_SERIES = range(1000, 1300)
_HARDWARE_ERRORS = (
    (0x01, "the supply voltage is outside its range"),
    (0x02, "the motor's Hall sensor fails"),
    (0x04, "overheated"),
    (0x08, "the motor's encoder fails"),
    (0x10, "electrical shock, or too little power to drive the motor"),
    (0x20, "overloaded"),
)


def is_x_series(model: int) -> bool:
    """Whether a model number is of the X series, whose table this is; the numbers of all lie together."""
    return model in _X_SERIES


def hardware_words(error: int) -> str:
    """The text of HARDWARE_ERROR; empty if it is 0."""
    errors = [words for bit, words in _HARDWARE_ERRORS if error & bit]
    unknown = error & ~sum(bit for bit, _ in _HARDWARE_ERRORS)
    if unknown:
        errors.append(f"hardware error 0x{unknown:02x}")
    return ", ".join(errors)


def health_words(stretch: bytes) -> str:
    """The faults in HEALTH's bytes as text; empty if there are none."""

    def value(register: Register) -> int:
        at = register.address - HEALTH.address
        return register.decode(stretch[at : at + register.size])

    error = hardware_words(value(HARDWARE_ERROR))
    if error:
        return f"{error}; its torque is off: fix the cause, then switch its power off and on"
    if value(BUS_WATCHDOG) == WATCHDOG_TRIPPED:
        return "stopped by itself: nothing came over the bus in time"
    return "" if value(TORQUE) else "its torque is off, as after a loss of power"


def current_and_position(stretch: int) -> tuple[int, int]:
    """The present current, in the model's unit, and PRESENT_POSITION, of PRESENT's value."""
    data = PRESENT.encode(stretch)
    return int.from_bytes(data[:2], "little", signed=True), position_at_end(data)


def position_at_end(stretch: bytes) -> int:
    """PRESENT_POSITION of PLACE's bytes."""
    return PRESENT_POSITION.decode(stretch[-PRESENT_POSITION.size :])


def profile_velocity(velocity_rad_s: Array | float) -> int:
    """The least PROFILE_VELOCITY that allows a velocity, rad/s."""
    return max(1, -int(-float(velocity_rad_s) // RAD_S_PER_UNIT))
