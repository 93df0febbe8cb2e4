"""A recording on an even grid: at each instant, the newest of everything that had arrived by then. Pure.

So a model that learns from it sees no more than the operator's or the robot's side saw at that instant.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from common.clock import to_ns, to_s
from common.errors import CodecError
from common.quaternion import Array
from common.recording import Entry
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from common.wire.video import JPEG, VideoFrame, decode_frame
from deploy.recorded.pictures import PictureDecoder, as_jpeg

FRESH_S = 0.5
"""A state or command that is older says nothing about now."""


@dataclass(frozen=True, slots=True)
class HeldFrame:
    """One instant of the grid."""

    time_s: float
    """Since the first message."""
    wall_ns: int
    """ns since 1970."""
    guard: str
    """Its state; empty while the robot is silent."""
    encoder_rad: Array
    """(J,) NaN where an encoder was not valid, and while the robot is silent."""
    setpoint_rad: Array
    """(J,) NaN while the robot is silent."""
    operator_rad: Array
    """(J,) of the newest command; NaN where there was none within 0.5 s, or not valid."""
    effort_nm: Array
    """(J,) NaN where none is told, and while the robot is silent."""
    pictures: dict[str, VideoFrame]
    """By camera, as JPEG; each frame bears its number."""
    fresh: bool
    """Whether the state is younger than 0.5 s; else the robot is silent."""


@dataclass(slots=True)
class _Newest:
    """What has arrived so far."""

    joints: int
    state: RobotState | None = None
    state_ns: int = 0
    command: Command | None = None
    command_ns: int = 0
    pictures: dict[str, VideoFrame] = field(default_factory=dict)
    decoders: dict[str, PictureDecoder] = field(default_factory=dict)

    def take(self, entry: Entry) -> bool:
        """Keep one message; False where it cannot be read as this robot's."""
        parts = entry.topic.split("/")
        try:
            if parts[-1] == "state":
                self.state, self.state_ns = decode(entry.payload, RobotState, self.joints), entry.monotonic_ns
            elif parts[-1] == "command":
                self.command, self.command_ns = (
                    decode(entry.payload, Command, self.joints),
                    entry.monotonic_ns,
                )
            elif len(parts) > 2 and parts[-2] == "video":
                self._picture(parts[-1], decode_frame(entry.payload))
        except CodecError:
            return False
        return True

    def _picture(self, camera: str, frame: VideoFrame) -> None:
        """H.264 becomes JPEG as it comes: a picture builds on the one before, and pixels take memory."""
        if frame.codec != JPEG:
            pixels = self.decoders.setdefault(camera, PictureDecoder()).decode(frame)
            if pixels is None:
                return
            frame = replace(frame, body=as_jpeg(frame, pixels, quality=95), codec=JPEG, after=0)
        self.pictures[camera] = frame


class HeldFrames:
    """Goes through a recording; `unreadable` counts messages of another profile or version."""

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        self._skeleton = skeleton
        self._period_ns = to_ns(1.0 / fps)
        self.unreadable = 0

    def of(self, entries: Iterable[Entry]) -> Iterator[HeldFrame]:
        """The grid from the first state to the last message. What arrives at an instant counts for it."""
        newest = _Newest(len(self._skeleton.joints))
        began_ns, due_ns, wall_less_ns = 0, 0, 0
        for entry in entries:
            if not began_ns:
                began_ns = due_ns = entry.monotonic_ns
            wall_less_ns = entry.wall_ns - entry.monotonic_ns
            while due_ns < entry.monotonic_ns:
                if newest.state is not None:
                    yield self._frame(newest, newest.state, due_ns, began_ns, wall_less_ns)
                due_ns += self._period_ns
            self.unreadable += not newest.take(entry)

    def _frame(
        self, newest: _Newest, state: RobotState, due_ns: int, began_ns: int, wall_less_ns: int
    ) -> HeldFrame:
        nothing, oldest_ns = np.full(len(self._skeleton.joints), np.nan), due_ns - to_ns(FRESH_S)
        command = newest.command if newest.command_ns >= oldest_ns else None
        fresh = newest.state_ns >= oldest_ns
        return HeldFrame(
            time_s=to_s(due_ns - began_ns),
            wall_ns=due_ns + wall_less_ns,
            guard=state.guard if fresh else "",
            encoder_rad=np.where(state.encoder_valid & fresh, state.position_rad, np.nan),
            setpoint_rad=state.setpoint_rad if fresh else nothing,
            operator_rad=nothing
            if command is None
            else np.where(command.valid, command.position_rad, np.nan),
            effort_nm=nothing if state.effort_nm is None or not fresh else state.effort_nm,
            pictures=dict(newest.pictures),
            fresh=fresh,
        )
