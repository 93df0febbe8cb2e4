"""A CANopen drive as an emergency stop input: one of its digital inputs, or its safe torque off. Pure."""

from __future__ import annotations

from collections.abc import Callable

from slave.servos.signs import DriveSigns
from slave.stop_inputs.config import StopInputConfig
from slave.stop_inputs.source import Level


class DriveStop:
    """A `StopSource`. It has nothing to open: the drives send at every SYNC, once they are configured."""

    def __init__(self, config: StopInputConfig, signs: Callable[[str], DriveSigns]) -> None:
        self._config = config
        self._signs = signs

    def start(self) -> None:
        """The servos are started by themselves."""

    def read(self) -> Level:
        """What the drive said with the newest SYNC."""
        signs = self._signs(self._config.joint)
        if self._config.source == "sto":
            return torque(signs)
        if not signs.inputs_ns:
            return Level(0, None, "its drive has not sent its inputs (60FDh) yet")
        return Level(signs.inputs_ns, bool(signs.inputs >> (self._config.bit or 0) & 1))

    def stop(self) -> None:
        """The servos are stopped by themselves."""


def torque(signs: DriveSigns) -> Level:
    """Whether a drive's torque is off (STO), by what makers have in common.

    The level is bit 4 of the statusword. Besides it only moments are known: an emergency message, or a fall
    out of operation without one. Those stay until a reset has tried to enable the drive again.
    """
    if not signs.heard_ns:
        return Level(0, None, "its drive has not answered yet")
    if not signs.voltage:
        return Level(signs.heard_ns, False, "its motor stage has no voltage", signs.torque_off_ns)
    return Level(signs.heard_ns, True, signs.torque_off, signs.torque_off_ns)
