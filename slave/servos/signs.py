"""What one drive tells of its torque and its digital inputs, for emergency stop inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@dataclass(frozen=True, slots=True)
class DriveSigns:
    """Times are of the slave's clock, ns; 0: never."""

    heard_ns: int
    """The newest SYNC that it answered."""
    voltage: bool
    """Statusword bit 4: its motor stage has voltage."""
    torque_off_ns: int
    """When it said last, otherwise than by that bit, that it has no torque; a reset does not undo it."""
    torque_off: str
    """What it said."""
    inputs_ns: int
    """When its digital inputs came last; only a drive of `tell_inputs` sends them."""
    inputs: int
    """60FDh."""


@runtime_checkable
class TellingServos(Protocol):
    """Servos whose drives tell of their torque and inputs."""

    def signs(self, joint: str) -> DriveSigns:
        """What the drive of a joint tells."""
        ...
