"""The alarms, their priorities and melodies. Pure.

After public descriptions of IEC 60601-1-8 (table 3: ten pulses, three, one or two; the time between bursts).
No claim of conformity is made: nobody has tested it, and levels in a room are the site's to set.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

from common.clock import to_ns


class Priority(IntEnum):
    """Of an alarm: how soon somebody must act."""

    LOW = 1
    MEDIUM = 2
    HIGH = 3


class Alarm(StrEnum):
    """What the operator is told. Of one priority the first is the most urgent."""

    ESTOP = "emergency stop"
    CONTACT = "contact"
    HOLD = "the robot holds"
    CLAMP = "beyond reach"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Melody:
    """How an alarm sounds."""

    priority: Priority
    pitches_hz: tuple[float, ...]
    """Of the pulses; a high one's five are played twice."""
    meaning: str


_C4, _E4, _G4, _A4, _C5, _E5, _G5 = 261.63, 329.63, 392.0, 440.0, 523.25, 659.26, 783.99

MELODIES = {
    Alarm.ESTOP: Melody(Priority.HIGH, (_C5, _C5, _C5, _C5, _C5), "an emergency stop is latched"),
    Alarm.CONTACT: Melody(Priority.HIGH, (_E5, _C5, _G5, _E5, _C5), "the robot has touched something"),
    Alarm.HOLD: Melody(Priority.MEDIUM, (_A4, _E4, _C4), "the robot no longer follows"),
    Alarm.CLAMP: Melody(Priority.LOW, (_E4, _G4), "a posture is beyond what the robot can reach"),
    Alarm.WARNING: Melody(Priority.LOW, (_G4, _E4), "the robot or the suit reports something"),
}
"""Every alarm. Rising and falling tell two of one priority apart."""

REPEATS_NS: dict[Priority, int | None] = {
    Priority.HIGH: to_ns(5.0),
    Priority.MEDIUM: to_ns(10.0),
    Priority.LOW: None,
}
"""From the end of a burst to the next while its cause lasts; None: it is told once."""
QUIET_NS = {Priority.HIGH: 0, Priority.MEDIUM: to_ns(2.5), Priority.LOW: to_ns(15.0)}
"""From the end of a burst to the next of the same alarm, however often its cause comes and goes."""
