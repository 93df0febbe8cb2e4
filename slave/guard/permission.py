"""What the guard lets the robot do in one turn of the servo loop."""

from __future__ import annotations

from dataclasses import dataclass

from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.states import MOVING, State


@dataclass(frozen=True, slots=True)
class Permission:
    """For the stages behind the guard: track and limit."""

    state: State
    dt_s: float
    """Time by which the setpoint may move on."""
    free: Mask
    """(J,) joints that may move: they do not rest, and the operator's node and their encoder are believed."""
    ready: bool
    """False until it is known where every joint stands: then there is no setpoint."""
    seat_rad: Array | None = None
    """(J,) Put the setpoint here first, at rest; None: it stays where it is."""

    @property
    def moving(self) -> bool:
        """Whether the robot follows the operator."""
        return self.state in MOVING
