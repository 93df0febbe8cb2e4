"""Everything that goes into a `MasterPipeline`, and what came out, as messages of a recording. Pure.

Two topics. `suit/frames`: one message a tick with all calls since the tick before, in order, with the times
that they were called with; a pipeline given the same calls gives the same joint angles, bit for bit.
`suit/angles`: the joint angles of one deciding tick, to compare with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import msgpack
import numpy as np

from common.can.frame import CanFrame
from common.errors import RecordingError
from common.quaternion import Array
from common.wire.messages import Mask
from master.joint_angles.sample import JointAngleSample

FRAMES = "suit/frames"
ANGLES = "suit/angles"
SNAPSHOT = "suit/snapshot"
MISSING = "suit/missing"
"""Stands where a recorder missed messages: what follows cannot be computed before the next snapshot."""
VERSION = 1
TICK, FRAME, CLOSE, BUS_DOWN, ZERO_POSE, DECIMATION = range(6)
"""The calls, by the number that begins each: [TICK, tick, now_ns], [FRAME, bus, identifier, data, now_ns],
[CLOSE, now_ns], [BUS_DOWN, bus], [ZERO_POSE, asked by, now_ns], [DECIMATION, ticks]."""

Call = tuple[object, ...]
Put = Callable[[str, bytes], object]
_pack = msgpack.Packer(autoreset=True).pack


class Pipeline(Protocol):
    """What is called of a `MasterPipeline` while the suit is polled."""

    def tick(self, tick: int, now_ns: int) -> tuple[CanFrame, JointAngleSample | None]:
        """Open a tick."""

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take one frame."""

    def frames(self, bus: str, frames: list[tuple[int, bytes, int]]) -> None:
        """Take frames of a bus of which none is awaited: identifier, data, arrival in ns."""

    def close(self, now_ns: int) -> JointAngleSample | None:
        """End a tick."""

    def bus_down(self, bus: str) -> None:
        """Count the nodes of a failed bus as lost."""

    def ask_zero_pose(self, by: str, now_ns: int) -> None:
        """The operator asks for the zero pose to be taken again."""

    def set_decimation(self, ticks: int) -> None:
        """From now on one tick in so many decides."""


class JournaledPipeline:
    """Passes each call on to a pipeline and writes it down."""

    def __init__(self, pipeline: Pipeline, put: Put, wanted: Callable[[], bool] = lambda: True) -> None:
        """`put` takes a topic and a message; it must not block. `wanted`: whether anybody reads them."""
        self._pipeline = pipeline
        self._put = put
        self._wanted = wanted
        self._calls: list[Call] = []
        self._decimation: int | None = None

    def tick(self, tick: int, now_ns: int) -> tuple[CanFrame, JointAngleSample | None]:
        """Open a tick; all calls before it are put as one message."""
        self.flush()
        self._calls.append((TICK, tick, now_ns))
        sync, late = self._pipeline.tick(tick, now_ns)
        return sync, self._out(late)

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take one frame."""
        self._calls.append((FRAME, bus, frame_id, data, now_ns))
        return self._pipeline.frame(bus, frame_id, data, now_ns)

    def frames(self, bus: str, frames: list[tuple[int, bytes, int]]) -> None:
        """Take frames of a bus of which none is awaited; they are written down one by one."""
        if self._wanted():
            self._calls += [(FRAME, bus, *frame) for frame in frames]
        self._pipeline.frames(bus, frames)

    def close(self, now_ns: int) -> JointAngleSample | None:
        """End a tick."""
        self._calls.append((CLOSE, now_ns))
        return self._out(self._pipeline.close(now_ns))

    def bus_down(self, bus: str) -> None:
        """Count the nodes of a failed bus as lost."""
        self._calls.append((BUS_DOWN, bus))
        self._pipeline.bus_down(bus)

    def ask_zero_pose(self, by: str, now_ns: int) -> None:
        """The operator asks for the zero pose to be taken again."""
        self._calls.append((ZERO_POSE, by, now_ns))
        self._pipeline.ask_zero_pose(by, now_ns)

    def set_decimation(self, ticks: int) -> None:
        """From now on one tick in so many decides."""
        self._decimation = ticks
        self._calls.append((DECIMATION, ticks))
        self._pipeline.set_decimation(ticks)

    def begin_again(self) -> None:
        """A reader may begin here: what is in force comes first, where it is not what the file says."""
        self.flush()
        if self._decimation is not None:
            self._calls.append((DECIMATION, self._decimation))

    def flush(self) -> None:
        """Put what was called since the last time."""
        if self._calls and self._wanted():
            self._put(FRAMES, _pack((VERSION, self._calls)))
        self._calls.clear()

    def _out(self, angles: JointAngleSample | None) -> JointAngleSample | None:
        if angles is not None and self._wanted():
            self._put(ANGLES, encode_angles(angles))
        return angles


@dataclass(frozen=True, slots=True)
class RecordedAngles:
    """A recorded answer of the pipeline."""

    tick: int
    sampled_ns: int
    position_rad: Array
    """(J,)."""
    valid: Mask
    """(J,)."""
    payload: bytes
    """As recorded: two answers are the same where these bytes are."""


def encode_angles(angles: JointAngleSample) -> bytes:
    """One deciding tick: version, ticks and times, position rad, velocity rad/s, which are valid, doubt."""
    out: bytes = _pack(
        (
            VERSION,
            angles.tick,
            angles.sampled_ns,
            angles.frames_in_ns,
            angles.position_rad.astype("<f8").tobytes(),
            angles.velocity_rad_s.astype("<f8").tobytes(),
            angles.valid.tobytes(),
            angles.doubt,
        )
    )
    return out


def decode_angles(payload: bytes) -> RecordedAngles:
    """Read one back. Raises RecordingError."""
    version, *rest = _unpack(ANGLES, payload)
    if version != VERSION:
        raise RecordingError(f"a message of {ANGLES} is of version {version}, not {VERSION}")
    match rest:
        case [int(tick), int(sampled_ns), int(), bytes(position), bytes(), bytes(valid), str()]:
            position_rad = np.frombuffer(position, "<f8")
            return RecordedAngles(tick, sampled_ns, position_rad, np.frombuffer(valid, np.bool_), payload)
    raise RecordingError(f"a message of {ANGLES} is not of version {VERSION}")


def decode_calls(payload: bytes) -> Sequence[Call]:
    """The calls of one message of `suit/frames`. Raises RecordingError."""
    version, *rest = _unpack(FRAMES, payload)
    if version != VERSION or len(rest) != 1 or not isinstance(rest[0], tuple):
        raise RecordingError(f"a message of {FRAMES} is of version {version}, not {VERSION}")
    calls: tuple[Call, ...] = rest[0]
    return calls


def _unpack(topic: str, payload: bytes) -> tuple[object, ...]:
    try:
        fields = msgpack.unpackb(payload, use_list=False)
    except Exception:  # msgpack raises its own family
        raise RecordingError(f"a message of {topic} cannot be read") from None
    if not isinstance(fields, tuple) or not fields:
        raise RecordingError(f"a message of {topic} is not a list of fields")
    return fields


def apply(call: Call, pipeline: Pipeline) -> JointAngleSample | None:
    """Make one recorded call. Raises RecordingError where it is none."""
    match call:
        case (int(kind), int(tick), int(now_ns)) if kind == TICK:
            return pipeline.tick(tick, now_ns)[1]
        case (int(kind), str(bus), int(frame_id), bytes(data), int(now_ns)) if kind == FRAME:
            pipeline.frame(bus, frame_id, data, now_ns)
        case (int(kind), int(now_ns)) if kind == CLOSE:
            return pipeline.close(now_ns)
        case (int(kind), str(bus)) if kind == BUS_DOWN:
            pipeline.bus_down(bus)
        case (int(kind), str(by), int(now_ns)) if kind == ZERO_POSE:
            pipeline.ask_zero_pose(by, now_ns)
        case (int(kind), int(ticks)) if kind == DECIMATION and ticks > 0:
            pipeline.set_decimation(ticks)
        case _:
            raise RecordingError(f"a message of {FRAMES} has a call that is none: {str(call)[:60]}")
    return None
