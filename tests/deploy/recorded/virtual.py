"""Recordings of a run on the virtual clock: the master's and the slave's, with what their taps hand on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import msgpack
import numpy as np
import simplejpeg

from common.recording import McapRecorder
from common.wire.codec import encode
from common.wire.video import VideoFrame, encode_frame
from deploy.sim.suit.motion import OperatorMotion
from deploy.sim.world.world import VirtualWorld, WorldSettings
from master.journal.calls import SNAPSHOT, JournaledPipeline
from master.journal.context import describe as describe_master
from master.journal.memory import recall
from slave.tap import RobotTick, SlaveTap
from slave.tap import describe as describe_slave

JPEG: bytes = simplejpeg.encode_jpeg(np.full((240, 320, 3), 96, dtype=np.uint8))
WALL_NS = 1_700_000_000_000_000_000
MOST_QUEUED = 1_000_000
"""A virtual second takes less time than a disk does."""


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The two files, and the world that they were recorded in."""

    master: Path
    slave: Path
    world: VirtualWorld


class _FileReaders:
    """Stands for a recorder behind a tap."""

    read, behind = True, False

    def __init__(self, recorder: McapRecorder, now_ns: Callable[[], int]) -> None:
        self._recorder, self._now_ns = recorder, now_ns

    def put(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        assert self._recorder.put(topic, payload, self._now_ns() if stamp_ns is None else stamp_ns)

    def put_snapshot(self, topic: str, payload: bytes) -> None:
        self.put(topic, payload)


class _JournaledMaster(JournaledPipeline):
    """A journal that also has what the world reads of its master."""

    def __getattr__(self, name: str) -> object:
        return getattr(self._pipeline, name)


class RecordedWorld(VirtualWorld):
    """A world whose master and slave are recorded from the first tick on."""

    def __init__(
        self,
        settings: WorldSettings,
        master: McapRecorder,
        slave: McapRecorder,
        change: Callable[[RobotTick], RobotTick],
        with_pictures: bool,
    ) -> None:
        super().__init__(settings)
        self._with_pictures = with_pictures
        self._change = change
        self._of_master = _FileReaders(master, lambda: self.master_ns)
        self._of_slave = _FileReaders(slave, lambda: self.slave_ns)
        self._slave_tap = SlaveTap(self._of_slave)
        self._key = f"tandem/{self.robot}"
        self._of_master.put(SNAPSHOT, msgpack.packb(recall(self._master)))
        self._master = _JournaledMaster(self._master, self._of_master.put)  # type: ignore[assignment]  # it passes on all that is called

    def on_command(self, payload: bytes, sender: str | None = None) -> None:
        super().on_command(payload, sender)
        self._of_slave.put(f"{self._key}/operator/nurse/command", payload)

    def _drive(self) -> None:
        super()._drive()
        target, setpoint, reading = self.slave.motion.target, self.slave._setpoint, self.slave._reading
        assert reading is not None
        asked = None if target is None else target.position_rad
        read = self.slave.position_rad
        tick = RobotTick(
            self.slave_ns, reading.read_ns, setpoint.ready, setpoint.position_rad, read, reading.valid, asked
        )
        guard = self.slave.guard
        self._slave_tap.tick(self._change(tick), str(guard.state), guard.reason)

    def _on_state(self, payload: bytes) -> None:
        super()._on_state(payload)
        self._of_master.put(f"{self._key}/state", payload)
        self._of_slave.put(f"{self._key}/state", payload)
        if self.commands:
            self._of_master.put(f"{self._key}/operator/nurse/command", encode(self.commands[-1]))
        if self._with_pictures and len(self.states) % 4 == 1:
            frame = VideoFrame(len(self.states), self.slave_ns, self.slave_ns, 320, 240, JPEG)
            self._of_slave.put(f"{self._key}/video/head", encode_frame(frame))


def record_run(
    folder: Path,
    story: Callable[[VirtualWorld], object],
    change: Callable[[RobotTick], RobotTick] = lambda tick: tick,
    motion: OperatorMotion | None = None,
    overrides: dict[str, list[str]] | None = None,
    with_pictures: bool = False,
) -> RecordedRun:
    """Play a story from the master's first tick on, into `master.mcap` and `slave.mcap`.

    `change` falsifies what the slave's tap tells.
    """
    settings = WorldSettings(motion=motion, overrides=overrides or {})
    plain = VirtualWorld(settings)
    clock: list[VirtualWorld] = [plain]
    with ExitStack() as kept:
        recorders = [
            kept.enter_context(
                McapRecorder(
                    folder / f"{name}.mcap",
                    metadata,
                    capacity=MOST_QUEUED,
                    wall=lambda: WALL_NS + clock[-1].now_ns,
                )
            )
            for name, metadata in (
                ("master", describe_master(plain.master_config)),
                ("slave", describe_slave(plain.robot, plain.slave_config.skeleton)),
            )
        ]
        world = RecordedWorld(settings, recorders[0], recorders[1], change, with_pictures)
        clock.append(world)
        story(world)
    assert not any(recorder.counters.refused for recorder in recorders)
    return RecordedRun(folder / "master.mcap", folder / "slave.mcap", world)
