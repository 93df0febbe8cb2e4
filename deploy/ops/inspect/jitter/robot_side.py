"""The stages that a recording holds as messages: received, tracked, limited, encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from common.clock import NS_PER_S
from common.errors import CodecError
from common.quaternion import Array
from common.recording import Entry, RecordingStream
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, Mask, RobotState
from deploy.ops.inspect.jitter.bands import Signal
from deploy.ops.inspect.jitter.sound import sound
from deploy.recorded.robots import robot_of
from slave.tap import GUARD, TICK, decode_guard, decode_tick

FOLLOWS = "track"
"""The guard's state in which the robot moves as the operator does."""


@dataclass(slots=True)
class _StageRows:
    """One stage as it is gathered: its own clock, angles, which are valid; each message's time of day."""

    stamp_ns: list[int] = field(default_factory=list)
    angle_rad: list[Array] = field(default_factory=list)
    valid: list[Mask] = field(default_factory=list)
    late_ns: list[int] = field(default_factory=list)

    def add(self, stamp_ns: int, angle_rad: Array, valid: Mask, wall_ns: int) -> None:
        """One row; what is not newer than the row before is left out."""
        if self.stamp_ns and stamp_ns <= self.stamp_ns[-1]:
            return
        self.stamp_ns.append(stamp_ns)
        self.angle_rad.append(angle_rad)
        self.valid.append(valid)
        self.late_ns.append(wall_ns - stamp_ns)

    def signal(self, stage: str, joints: Sequence[str]) -> Signal | None:
        """By its own stamps, which are even, laid on the time of day by the median of all."""
        if len(self.stamp_ns) < 2:
            return None
        shift_ns = int(np.median(self.late_ns))
        time_s = np.array([(at + shift_ns) / NS_PER_S for at in self.stamp_ns])
        return sound(stage, joints, time_s, np.array(self.angle_rad), np.array(self.valid))


class RobotSide:
    """Takes the messages of one recording; what was measured tick by tick comes before what states said.

    Of several robots the first counts: the postures of two, one after the other, would look like jitter.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._guard = ""
        self._robot = ""
        names = ("received", "tracked", "limited", "encoders", "limited by states", "encoders by states")
        self._rows = {name: _StageRows() for name in names}

    def take(self, entry: Entry) -> None:
        """One message; one that cannot be read as this profile's is left out."""
        name = entry.topic.rpartition("/")[2]
        if entry.topic == TICK:
            self._tick(entry)
        elif entry.topic == GUARD:
            self._guard = decode_guard(entry.payload)[1]
        elif name in ("command", "state"):
            self._robot = self._robot or robot_of(entry.topic)
            if robot_of(entry.topic) != self._robot:
                return
            try:
                (self._command if name == "command" else self._state)(entry)
            except CodecError:
                return

    def _tick(self, entry: Entry) -> None:
        tick = decode_tick(entry.payload)
        if self._guard != FOLLOWS:
            return
        all_ = np.ones_like(tick.valid)
        if tick.target_rad is not None:
            self._rows["tracked"].add(tick.now_ns, tick.target_rad, all_, entry.wall_ns)
        self._rows["limited"].add(tick.now_ns, tick.setpoint_rad, all_, entry.wall_ns)
        self._rows["encoders"].add(tick.read_ns, tick.position_rad, tick.valid, entry.wall_ns)

    def _command(self, entry: Entry) -> None:
        command = decode(entry.payload, Command, len(self._skeleton.joints))
        self._rows["received"].add(
            command.stamps.sampled_ns, command.position_rad, command.valid, entry.wall_ns
        )

    def _state(self, entry: Entry) -> None:
        state = decode(entry.payload, RobotState, len(self._skeleton.joints))
        if state.guard != FOLLOWS:
            return
        all_ = np.ones_like(state.encoder_valid)
        self._rows["limited by states"].add(state.encoder_ns, state.setpoint_rad, all_, entry.wall_ns)
        self._rows["encoders by states"].add(
            state.encoder_ns, state.position_rad, state.encoder_valid, entry.wall_ns
        )

    def stages(self) -> dict[str, Signal]:
        """What was heard, in the order of the way."""
        found = {}
        for stage in ("received", "tracked", "limited", "encoders"):
            signal = self._rows[stage].signal(stage, self._skeleton.joint_names)
            if signal is None and f"{stage} by states" in self._rows:
                signal = self._rows[f"{stage} by states"].signal(stage, self._skeleton.joint_names)
            if signal is not None:
                found[stage] = signal
        return found


def robot_stages(
    files: Sequence[Path], skeleton: Skeleton, from_wall_ns: int, until_wall_ns: int
) -> dict[str, Signal]:
    """The stages of a recording's messages between two times of day."""
    side = RobotSide(skeleton)
    for path in files:
        for entry in RecordingStream(path):
            if entry.wall_ns > until_wall_ns:
                break
            if entry.wall_ns >= from_wall_ns or entry.topic == GUARD:
                side.take(entry)
    return side.stages()
