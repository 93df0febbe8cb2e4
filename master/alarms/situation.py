"""What is the matter with one robot, as alarms. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from master.alarms.alarm import Alarm

_ENGAGED = ("align", "track", "clutch")
_DISENGAGED, _PUSHED = "disengaged by", "pushed at"
"""How the guard's reasons begin."""


@dataclass(frozen=True, slots=True)
class RobotSign:
    """What is known of a robot at a moment."""

    guard: str = ""
    """Its guard's state; empty where the robot is not heard."""
    reason: str = ""
    ours: bool = True
    """Whether this operator holds the lease."""
    faults: bool = False


class RobotAlarms:
    """The alarms of one robot that this master commands."""

    def __init__(self) -> None:
        self.engaged = False
        """Whether it follows this operator."""
        self._held = False

    def step(self, sign: RobotSign) -> frozenset[Alarm]:
        """The alarms that are active now."""
        if sign.guard in _ENGAGED:
            self.engaged, self._held = sign.ours, False
        elif self.engaged:
            # who disengages knows it; any other end of the motion is told, that of a robot not heard too
            self.engaged, self._held = False, not sign.reason.startswith(_DISENGAGED)
        if sign.guard in ("boot", "estop"):
            self._held = False
        pushed = sign.reason.startswith(_PUSHED)
        active = {
            Alarm.ESTOP: sign.guard == "estop",
            Alarm.CONTACT: self._held and pushed,
            Alarm.HOLD: self._held and not pushed,
            Alarm.WARNING: self.engaged and sign.faults,
        }
        return frozenset(alarm for alarm, is_so in active.items() if is_so)
