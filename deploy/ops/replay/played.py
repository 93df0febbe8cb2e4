"""A recorded motion at any speed, and what a robot that follows it is judged by. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from common.clock import NS_PER_S
from common.errors import RecordingError
from common.quaternion import Array
from common.wire.messages import Mask, RobotState
from master.joint_angles.sample import JointAngleSample

FOLLOWS = "track"


@dataclass(frozen=True, slots=True)
class PlayedMotion:
    """Joint angles at T instants of the recording; between them on straight lines."""

    time_s: Array
    """(T,) since its first."""
    position_rad: Array
    """(T, J)."""
    valid: Mask
    """(T, J)."""

    @property
    def seconds(self) -> float:
        """How long it lasts at its own speed."""
        return float(self.time_s[-1])

    def at(self, time_s: float, speed: float) -> tuple[Array, Array, Mask]:
        """Position (J,), its rate (J,) at this speed, and which joints are known, at an instant."""
        after = int(np.searchsorted(self.time_s, time_s, side="right"))
        if after == 0 or after >= len(self.time_s):
            edge = 0 if after == 0 else -1
            return self.position_rad[edge], np.zeros(self.position_rad.shape[1]), self.valid[edge]
        before = after - 1
        slope = (self.position_rad[after] - self.position_rad[before]) / (
            self.time_s[after] - self.time_s[before]
        )
        position = self.position_rad[before] + slope * (time_s - self.time_s[before])
        return position, speed * slope, self.valid[before] & self.valid[after]


def motion_of(samples: Iterable[JointAngleSample]) -> PlayedMotion:
    """From the first posture of which every joint is known. Raises RecordingError where there is none.

    A joint that is not known later keeps its last angle, and is not commanded.
    """
    rows: list[JointAngleSample] = []
    for sample in samples:
        if rows or (sample.valid.all() and not sample.doubt):
            rows.append(sample)
    if len(rows) < 2:
        raise RecordingError(
            "the recording has no posture of which every joint is known: nothing can be played"
        )
    position, valid = np.array([row.position_rad for row in rows]), np.array([row.valid for row in rows])
    for number in range(1, len(rows)):
        position[number] = np.where(valid[number], position[number], position[number - 1])
    time_s = np.array([(row.sampled_ns - rows[0].sampled_ns) / NS_PER_S for row in rows])
    return PlayedMotion(time_s, position, valid)


@dataclass(slots=True)
class PlayedFindings:
    """How the robot followed."""

    joints: Sequence[str]
    speed: float
    seconds: float = 0.0
    """Played, of the recording's own time."""
    followed: float = 0.0
    """Share of the states in which the robot followed."""
    holds: list[str] = field(default_factory=list)
    """Why it stopped following, each time."""
    rms_deg: dict[str, float] = field(default_factory=dict)
    """Encoders against the recorded angles at the same instant, while it followed."""


class FollowedWatch:
    """Takes the robot's states while a motion is played."""

    def __init__(self, motion: PlayedMotion, joints: Sequence[str], speed: float) -> None:
        self._motion = motion
        self.found = PlayedFindings(joints, speed)
        self._squares = np.zeros(len(joints))
        self._states, self._follows = 0, 0
        self._guard = FOLLOWS

    def take(self, state: RobotState, recorded_s: float) -> None:
        """A state that came at an instant of the recording."""
        self._states += 1
        self.found.seconds = max(self.found.seconds, recorded_s)
        if state.guard == FOLLOWS:
            self._follows += 1
            asked, _, _ = self._motion.at(recorded_s, 1.0)
            self._squares += np.degrees(state.position_rad - asked) ** 2
        elif self._guard == FOLLOWS:
            self.found.holds.append(f"{state.guard}: {state.reason}")
        self._guard = state.guard

    def findings(self) -> PlayedFindings:
        """Of all states so far."""
        found = self.found
        found.followed = self._follows / max(1, self._states)
        rms = np.sqrt(self._squares / max(1, self._follows))
        found.rms_deg = {name: float(value) for name, value in zip(found.joints, rms, strict=True)}
        return found
