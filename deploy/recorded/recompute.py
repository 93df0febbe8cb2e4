"""A recording's calls, made again to a fresh pipeline. Pure: entries in, joint angles out.

It begins at the first snapshot; where messages are missing in the middle, it goes on at the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import msgpack

from common.errors import RecordingError
from common.quaternion import Array
from master.config import MasterConfig
from master.joint_angles.sample import JointAngleSample
from master.journal.calls import (
    ANGLES,
    FRAMES,
    MISSING,
    SNAPSHOT,
    RecordedAngles,
    apply,
    decode_angles,
    decode_calls,
    encode_angles,
)
from master.journal.memory import restore
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol


class Recorded(NamedTuple):
    """One message of a recording."""

    topic: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class Recomputed:
    """The joint angles of one deciding tick: as recorded, and as computed now."""

    recorded: RecordedAngles
    computed: JointAngleSample

    @property
    def identical(self) -> bool:
        """To the last bit, validity, stamps and doubts included."""
        return encode_angles(self.computed) == self.recorded.payload

    @property
    def apart_rad(self) -> Array:
        """(J,) computed less recorded."""
        apart: Array = self.computed.position_rad - self.recorded.position_rad
        return apart


class Replay:
    """Computes a recording again, with the same configuration or another one."""

    def __init__(
        self,
        config: MasterConfig,
        from_snapshots: bool = True,
        look: Callable[[MasterPipeline], object] = lambda _: None,
    ) -> None:
        """`from_snapshots`: begin with what the recorded filters had learnt.

        False for another configuration, whose filters learn anew from the recording's beginning.
        `look` is called with the pipeline after each tick.
        """
        self._look = look
        self._config = config
        self._protocol = SuitProtocol.load(config.capture.dbc)
        self._from_snapshots = from_snapshots
        self._pipeline: MasterPipeline | None = None
        self._recorded: dict[int, RecordedAngles] = {}
        self.skipped = 0
        """Recorded joint angles that could not be computed: before a snapshot, or after missing messages."""
        self.unrecorded = 0
        """Joint angles that were computed now, and not when it was recorded."""
        self.ticks = 0

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the J joints."""
        return tuple(self._config.skeleton.joint_names)

    def pairs(self, entries: Iterable[Recorded]) -> Iterator[Recomputed]:
        """The joint angles, in order. Raises RecordingError."""
        for topic, payload in entries:
            if topic == SNAPSHOT:
                self._take_snapshot(payload)
            elif topic == MISSING:
                self._pipeline = None
            elif topic == FRAMES and self._pipeline is not None:
                self.ticks += 1
                yield from self._make_calls(payload, self._pipeline)
                self._look(self._pipeline)
            elif topic == ANGLES:
                angles = decode_angles(payload)
                self._recorded[angles.tick] = angles
        self._give_up()

    def _take_snapshot(self, payload: bytes) -> None:
        if self._pipeline is not None:
            return  # it goes on from what it computed: else a snapshot would hide that it went wrong
        self._give_up()
        self._pipeline = MasterPipeline(self._config, self._protocol)
        if self._from_snapshots:
            try:
                memory = msgpack.unpackb(payload, strict_map_key=False)
            except Exception:  # msgpack raises its own family
                raise RecordingError("a snapshot cannot be read") from None
            restore(self._pipeline, memory)

    def _give_up(self) -> None:
        self.skipped += len(self._recorded)
        self._recorded.clear()

    def _make_calls(self, payload: bytes, pipeline: MasterPipeline) -> Iterator[Recomputed]:
        """A tick's calls come after its joint angles in the file."""
        for call in decode_calls(payload):
            computed = apply(call, pipeline)
            if computed is None:
                continue
            recorded = self._recorded.pop(computed.tick, None)
            if recorded is None:
                self.unrecorded += 1
            else:
                yield Recomputed(recorded, computed)
