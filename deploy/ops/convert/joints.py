"""Joint angles over time, from what `tandem record` wrote."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_S
from common.errors import CodecError, RecordingError
from common.quaternion import Array
from common.recording import RecordingStream
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from common.wire.topics import COMMAND, STATE


class AngleSource(StrEnum):
    """Whose angles."""

    ENCODERS = "encoders"
    """Measured on the robot."""
    TARGETS = "targets"
    """Last written to the servos."""
    OPERATOR = "operator"
    """As commanded."""


@dataclass(frozen=True, slots=True)
class JointSeries:
    """Joint angles at T instants of one clock."""

    names: tuple[str, ...]
    time_ns: NDArray[np.int64]
    """(T,) rising, ns of the robot's clock (of the operator's for AngleSource.OPERATOR)."""
    wall_ns: int
    """When the first was recorded, ns since 1970."""
    position_rad: Array
    """(T, J); NaN where a joint was not valid."""
    notes: tuple[str, ...] = ()

    @property
    def time_s(self) -> Array:
        """(T,) since the first."""
        return np.asarray((self.time_ns - self.time_ns[0]) / NS_PER_S)

    @property
    def rate_hz(self) -> float:
        """By the median step."""
        return float(1.0 / np.median(np.diff(self.time_s)))

    def held(self) -> tuple[Array, int]:
        """Positions in which a joint that is not valid keeps its last angle (0 before), and how many."""
        missing = ~np.isfinite(self.position_rad)
        rows = np.where(missing, 0, np.arange(len(self.position_rad))[:, None])
        last = np.take_along_axis(self.position_rad, np.maximum.accumulate(rows, axis=0), axis=0)
        return np.nan_to_num(last), int(missing.sum())


def read_joints(path: Path, skeleton: Skeleton, source: AngleSource) -> JointSeries:
    """The angles of a recording. Raises RecordingError where it holds none for this profile."""
    topic = COMMAND if source is AngleSource.OPERATOR else STATE
    kind: type[Command] | type[RobotState] = Command if source is AngleSource.OPERATOR else RobotState
    stream = RecordingStream(path)
    rows: list[tuple[int, Array]] = []
    wall_ns, unreadable, keys = 0, 0, set()
    for entry in stream:
        if entry.topic.rpartition("/")[2] != topic.name:
            continue
        try:
            row = _row(decode(entry.payload, kind, len(skeleton.joints)), source)
        except CodecError as error:
            unreadable, why = unreadable + 1, str(error)
            continue
        keys.add(entry.topic)
        wall_ns = wall_ns or entry.wall_ns
        rows.append(row)
    if len(keys) > 1:
        raise RecordingError(
            f"{path}: holds {topic.name}s of {', '.join(sorted(keys))}: record one at a time"
        )
    if len(rows) < 2:
        if unreadable:
            raise RecordingError(
                f"{path}: none of its {unreadable} {topic.name}s fits the profile {skeleton.name} ({why}); "
                "give the robot's own as --profile NAME"
            )
        raise RecordingError(f"{path}: holds no {topic.name}s; `tandem inspect {path.name}` shows its topics")
    # several states show one reading of the encoders, and messages may overtake each other
    rows.sort(key=lambda row: row[0])
    time_ns = np.array([at for at, _ in rows], dtype=np.int64)
    new = np.diff(time_ns, prepend=time_ns[0] - 1) > 0
    notes = [f"{unreadable} {topic.name}s could not be read, left out"] if unreadable else []
    if stream.cut:
        notes.append(f"{stream.cut}: only the part before it is written")
    positions = np.array([position for _, position in rows])
    return JointSeries(skeleton.joint_names, time_ns[new], wall_ns, positions[new], tuple(notes))


def _row(message: Command | RobotState, source: AngleSource) -> tuple[int, Array]:
    if isinstance(message, Command):
        return message.stamps.sampled_ns, np.where(message.valid, message.position_rad, np.nan)
    if source is AngleSource.TARGETS:
        return message.encoder_ns, message.setpoint_rad
    return message.encoder_ns, np.where(message.encoder_valid, message.position_rad, np.nan)
