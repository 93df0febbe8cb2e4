"""The slave's side of the tap: what was written to the servos and read from the encoders, tick by tick.

Topics: `robot/tick`, one message a tick; `robot/guard`, one a change of the guard's state or reason.
Commands, states and all else of the link stand under their own keys.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import msgpack
import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.skeleton import Skeleton
from common.tap.readers import Readers
from common.wire.messages import Mask
from common.wire.version import software

TICK, GUARD = "robot/tick", "robot/guard"
VERSION = 2
_WITHOUT_TARGET = 1
"""The version before, which is still read: it has no target."""

_pack = msgpack.Packer(autoreset=True).pack


@dataclass(frozen=True, slots=True)
class RobotTick:
    """One turn of the servo loop."""

    now_ns: int
    read_ns: int
    """When the encoders were read."""
    ready: bool
    """Whether the setpoint was written."""
    setpoint_rad: Array
    """(J,)."""
    position_rad: Array
    """(J,) by the encoders."""
    valid: Mask
    """(J,) encoders that could be read."""
    target_rad: Array | None = None
    """(J,) where the tracker saw the operator, before the limits; None while the robot follows nobody."""


class SlaveTap:
    """Hands on the robot's ticks. Without readers it costs a comparison."""

    def __init__(self, readers: Readers) -> None:
        self._readers = readers
        self._guard: tuple[str, str] = "", ""

    @property
    def overhear(self) -> Callable[[str, bytes, int], None]:
        """Takes each message that was sent or heard on the link."""
        return self._readers.put

    def tick(self, tick: RobotTick, state: str, reason: str) -> None:
        """One tick is done. A reader that has just come, or lacks messages, is told the guard's state."""
        if not self._readers.read:
            return
        guard = _pack((VERSION, tick.now_ns, state, reason))
        if self._readers.behind:
            self._readers.put_snapshot(GUARD, guard)
        elif (state, reason) != self._guard:
            self._readers.put(GUARD, guard, tick.now_ns)
        self._guard = state, reason
        self._readers.put(TICK, encode_tick(tick), tick.now_ns)


def describe(robot: str, skeleton: Skeleton) -> Mapping[str, str]:
    """The metadata of a recording of this slave."""
    return {
        "role": "slave",
        "robot": robot,
        "profile": skeleton.name,
        "joints": json.dumps(list(skeleton.joint_names)),
        "tandem": software().tandem,
    }


def encode_tick(tick: RobotTick) -> bytes:
    """As a message: version, times, whether it was written, setpoints and positions, valid, target."""
    target = tick.target_rad
    out: bytes = _pack(
        (
            VERSION,
            tick.now_ns,
            tick.read_ns,
            tick.ready,
            tick.setpoint_rad.astype("<f8").tobytes(),
            tick.position_rad.astype("<f8").tobytes(),
            tick.valid.tobytes(),
            None if target is None else target.astype("<f8").tobytes(),
        )
    )
    return out


def decode_tick(payload: bytes) -> RobotTick:
    """Read one back, of this version or the one before. Raises RecordingError."""
    try:
        version, *fields = msgpack.unpackb(payload)
        if version == _WITHOUT_TARGET:
            fields.append(None)
        if version in (VERSION, _WITHOUT_TARGET):
            now_ns, read_ns, ready, setpoint, position, valid, target = fields
            return RobotTick(
                int(now_ns),
                int(read_ns),
                bool(ready),
                np.frombuffer(setpoint, "<f8"),
                np.frombuffer(position, "<f8"),
                np.frombuffer(valid, np.bool_),
                None if target is None else np.frombuffer(target, "<f8"),
            )
    except Exception:  # msgpack raises its own family, and a buffer may be of any length
        pass
    raise RecordingError(f"a message of {TICK} is not of version {VERSION}")


def decode_guard(payload: bytes) -> tuple[int, str, str]:
    """When the guard changed (ns, the slave's clock), its state and its reason. Raises RecordingError."""
    try:
        version, now_ns, state, reason = msgpack.unpackb(payload)
        if version in (VERSION, _WITHOUT_TARGET):
            return int(now_ns), str(state), str(reason)
    except Exception:  # msgpack raises its own family
        pass
    raise RecordingError(f"a message of {GUARD} is not of version {VERSION}")
