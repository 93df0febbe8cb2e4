"""What can be made to go wrong with a simulated drive."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from common.errors import ConfigError, ConfigMistake
from common.skeleton import Skeleton
from slave.servos.canopen.status_bits import FOLLOWS, LIMITED, REMOTE, VOLTAGE, WARNING

DEMAND = 0x2010
"""The manufacturer's object: a fault's number written to it happens at once."""


class DriveFault(IntEnum):
    """The faults, by their number in DEMAND."""

    NONE = 0
    OVER_CURRENT = 1
    OVER_TEMPERATURE = 2
    ENCODER_STUCK = 3
    MAGNET_LOST = 4
    PARITY = 5
    SILENT = 6
    RESTART = 7
    LOST_TURNS = 8
    """The drive's position is 0 where it stands: its battery was empty."""
    WRONG_ZERO = 9
    """The drive's position is off by 30° of the joint."""
    WRONG_GEAR = 10
    """The gear turns the joint by half of what is configured."""
    REVERSED = 11
    """Motor and motor encoder turn the joint the wrong way round."""
    DOUBLE_ID = 12
    """Another drive, 49° away, has the same node id."""
    ENCODER_ZERO = 13
    """The output encoder's word is 0 for ever."""
    RUNS_AWAY = 14
    """While enabled it moves at 60°/s by itself, whatever its target."""
    NOT_FOLLOWING = 15
    """Enabled, with bit 12 clear: it ignores its target."""
    LIMIT_ACTIVE = 16
    """Bit 11: a limit of its own is active."""
    LOCAL = 17
    """Bit 9 clear: it ignores controlwords and targets."""
    NO_VOLTAGE = 18
    """Bit 4 clear: its motor stage has no voltage, it holds by its brake."""
    WARNS = 19
    """Bit 7; it works."""
    WRONG_MODE = 20
    """It displays profile position, whatever mode is asked for."""
    POSITION_STUCK = 21
    """The drive's position stays what it was."""
    STO = 22
    """Safe torque off: "switch on disabled", bit 4 clear, until the input closes again."""
    STO_FAULT = 23
    """The same, told as a fault with an emergency message, not to be reset meanwhile; bit 4 stays set."""
    STO_QUIET = 24
    """The same, told by nothing but "switch on disabled", and bit 31 of 60FDh."""
    INPUT_OPEN = 25
    """The contact at its first digital input (60FDh, bit 16) is open."""
    INPUTS_SILENT = 26
    """It sends its digital inputs no more."""
    TORQUE_SILENT = 27
    """It does not tell its torque any more."""
    TORQUE_STUCK = 28
    """The torque that it tells stays what it was."""

    @property
    def option(self) -> str:
        """The fault's name on the command line."""
        return self.name.lower().replace("_", "-")


STATUS_BITS = {
    DriveFault.NOT_FOLLOWING: (FOLLOWS, 0),
    DriveFault.LIMIT_ACTIVE: (0, LIMITED),
    DriveFault.LOCAL: (REMOTE, 0),
    DriveFault.NO_VOLTAGE: (VOLTAGE, 0),
    DriveFault.WARNS: (0, WARNING),
    DriveFault.STO: (VOLTAGE, 0),
}
"""Bits of the statusword that a fault clears and sets."""
WITHHOLDS = {DriveFault.INPUTS_SILENT: "inputs", DriveFault.TORQUE_SILENT: "thousandths"}
"""What is no longer sent with a fault."""
IGNORES_TARGETS = (DriveFault.NOT_FOLLOWING, DriveFault.LOCAL, DriveFault.NO_VOLTAGE)
CODES = {DriveFault.OVER_CURRENT: (0x2310, 0x03), DriveFault.OVER_TEMPERATURE: (0x4310, 0x09)}
"""Emergency code and error register of those that are the drive's own."""
OPTIONS = {fault.option: fault for fault in DriveFault}


@dataclass(frozen=True, slots=True)
class PlannedDriveFault:
    """A fault that will happen."""

    joint: str
    fault: DriveFault
    after_s: float
    """Seconds after the first SYNC."""


def planned(text: str, skeleton: Skeleton) -> PlannedDriveFault:
    """Read `JOINT=FAULT@SECONDS`, such as `left_elbow_pitch=over-current@5`. Raises ConfigError."""
    joint, _, rest = text.partition("=")
    name, _, seconds = rest.partition("@")
    try:
        after_s = float(seconds or "0")
    except ValueError:
        after_s = -1.0
    if joint not in skeleton.joint_names:
        expected = f"a joint of the {skeleton.name} profile before the ="
    elif name not in OPTIONS:
        expected = f"after the = one of {', '.join(OPTIONS)}"
    elif not 0.0 <= after_s <= 1e6:
        expected = "seconds after the @"
    else:
        return PlannedDriveFault(joint, OPTIONS[name], after_s)
    raise ConfigError("tandem drives", [ConfigMistake("--fault", text, expected)])
