"""Slave's side and simulated drives on one virtual clock, joined by a wire of lists."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.peer import DrivePeer
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drives import Drives
from slave.servos.canopen.wiring import Outgoing

STEP_NS = 4 * NS_PER_MS


class Wired:
    """A drives and its drives; time passes in `run`."""

    def __init__(self, config: CanopenConfig | None = None, encoders: EncoderConfig | None = None) -> None:
        self.skeleton = load_skeleton("nursing")
        self.config = config or CanopenConfig()
        self.encoders = Encoders(self.skeleton, encoders)
        self.now_ns = 10**9
        self.alive = True
        """False: the slave is dead, its drives are on their own."""
        self.cut: set[str] = set()
        """Buses that carry nothing."""
        self.drives = Drives(self.config, self.skeleton, encoders)
        self.peer = DrivePeer(
            self.config, self.skeleton, encoders or EncoderConfig(), self._to_slave, self.now_ns
        )
        self.setpoint: Array | None = None
        self.torque_nm: Array | None = None
        self.positions: list[Array] = []
        """True joint angles, every 4 ms."""
        self._due_ns = self.now_ns

    def _to_slave(self, bus: str, frame_id: int, data: bytes) -> None:
        if self.alive and bus not in self.cut:
            self.drives.on_frame(bus, frame_id, data, self.now_ns)

    def _to_drives(self, frames: list[Outgoing]) -> None:
        for bus, frame_id, data in frames:
            if bus in self.cut:
                continue
            if data is None:
                self.peer.on_remote(bus, frame_id, self.now_ns)
            else:
                self.peer.on_frame(bus, frame_id, data, self.now_ns)

    def _flush(self) -> None:
        while self.drives.outbox:
            frames, self.drives.outbox = self.drives.outbox, []
            self._to_drives(frames)

    def start(self) -> None:
        self.drives.start(self.now_ns)
        self._flush()

    def up(self) -> None:
        """Started, and all running."""
        self.start()
        self.until(lambda: self.drives.running, 1.0)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.now_ns += STEP_NS
            self.peer.advance(self.now_ns)
            self.positions.append(self.peer.plant.position_rad)
            if self.alive and self.now_ns >= self._due_ns:
                self._due_ns = self.now_ns + self.config.period_ns
                self._to_drives(self.drives.cycle(self.now_ns, self.setpoint, self.torque_nm))
                self._flush()
                self._to_drives(self.drives.sync(self.now_ns))

    def until(self, condition: Callable[[], bool], seconds: float) -> None:
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            if condition():
                return
            self.run(STEP_NS / 1e9)
        raise AssertionError(f"not within {seconds} s: {dict(self.drives.faults)}")

    def happen(self, joint: str, fault: DriveFault) -> None:
        self.peer.happen(joint, fault)

    def read_rad(self) -> Array:
        return self.encoders.position_rad(self.drives.reading.counts)

    def where(self, joint: str) -> tuple[str, int]:
        """Bus and node id of a joint's drive."""
        drive = self.config.drives_of(self.skeleton)[joint]
        return drive.bus, drive.id

    def index(self, joint: str) -> int:
        return self.skeleton.joint_names.index(joint)

    def speed_rad_s(self, last_s: float) -> Array:
        """(K, J) of the last time, from the true angles."""
        rows = round(last_s * 1e9 / STEP_NS)
        return np.diff(np.array(self.positions[-rows:]), axis=0) / (STEP_NS / 1e9)


@pytest.fixture
def wired() -> Wired:
    return Wired()
