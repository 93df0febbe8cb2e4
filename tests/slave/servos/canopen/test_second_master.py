"""A second master is named by what it sends, and the robot stops and stands: no drive flips to and fro."""

from __future__ import annotations

import numpy as np
import pytest

from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.drives import Drives
from slave.servos.canopen.wiring import Outgoing
from tests.slave.servos.canopen.conftest import Wired

FRAMES = [
    (0x000, b"\x01\x00", "NMT commands"),
    (0x080, b"", "SYNC"),
    (0x601, b"\x40\x41\x60\x00" + bytes(4), "SDO requests to node 1 (neck_yaw)"),
    (0x202, b"\x0f\x00" + bytes(4), "targets (RPDO) for node 2"),
    (0x303, bytes(8), "targets (RPDO) for node 3"),
    (0x77F, b"\x05", "heartbeats with the slave's own node id 127"),
    (0x7E5, b"\x04\x01" + bytes(6), "LSS commands"),
]


@pytest.mark.parametrize(("frame_id", "data", "said"), FRAMES)
def test_a_frame_that_only_a_master_sends_stops_the_robot(
    wired: Wired, frame_id: int, data: bytes, said: str
) -> None:
    wired.up()
    wired.drives.on_frame("left", frame_id, data, wired.now_ns)
    wired._flush()
    faults = dict(wired.drives.faults)
    assert set(faults) == set(wired.skeleton.joint_names)
    assert all("a second master is on bus left" in words and said in words for words in faults.values())
    wired.run(0.1)
    assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
    wired.run(0.5)
    # not while it speaks, and by a reset once it has gone
    wired.drives.on_frame("left", frame_id, data, wired.now_ns)
    wired.drives.release(wired.now_ns)
    wired.run(0.3)
    assert not wired.drives.running
    wired.run(1.0)
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 1.5)
    assert dict(wired.drives.faults) == {}


@pytest.mark.parametrize(
    ("frame_id", "data"),
    [(0x081, bytes(8)), (0x27F, bytes(6)), (0x67E, bytes(8)), (0x77E, b"\x05"), (0x1FF, bytes(8))],
)
def test_frames_of_others_are_no_second_master(wired: Wired, frame_id: int, data: bytes) -> None:
    wired.up()
    wired.drives.on_frame("left", frame_id, data, wired.now_ns)
    wired.run(0.1)
    assert dict(wired.drives.faults) == {}


class TwoMasters(Wired):
    """A second drives on the same buses, which hears and is heard."""

    other: Drives | None = None

    def _to_slave(self, bus: str, frame_id: int, data: bytes) -> None:
        super()._to_slave(bus, frame_id, data)
        if self.other is not None:
            self.other.on_frame(bus, frame_id, data, self.now_ns)

    def _to_drives(self, frames: list[Outgoing]) -> None:
        super()._to_drives(frames)
        if self.other is not None:
            for bus, frame_id, data in frames:
                self.other.on_frame(bus, frame_id, data or b"", self.now_ns)

    def of_other(self, frames: list[Outgoing]) -> None:
        for bus, frame_id, data in frames:
            self.peer.on_frame(bus, frame_id, data or b"", self.now_ns)
            self.drives.on_frame(bus, frame_id, data or b"", self.now_ns)


def test_two_slaves_stop_the_robot_once_and_it_stands() -> None:
    wired = TwoMasters()
    wired.up()
    wired.setpoint = np.clip(np.full(25, 0.2), wired.skeleton.lower_rad, wired.skeleton.upper_rad)
    wired.run(0.5)
    other = wired.other = Drives(wired.config, wired.skeleton)
    other.start(wired.now_ns)
    changes, states = 0, [drive.state for drive in wired.peer.drives]
    for _ in range(100):
        wired.of_other(other.cycle(wired.now_ns, None))
        outbox, other.outbox = other.outbox, []
        wired.of_other(outbox)
        wired.of_other(other.sync(wired.now_ns))
        wired.run(0.02)
        now = [drive.state for drive in wired.peer.drives]
        changes += sum(a is not b for a, b in zip(states, now, strict=True))
        states = now
    assert changes == 25  # each drive stopped once
    assert set(states) == {Power.QUICK_STOP}
    assert np.abs(wired.speed_rad_s(1.5)).max() < 0.02
    for drives in (wired.drives, other):
        assert all("a second master" in words for words in drives.faults.values())
        assert len(drives.faults) == 25


def test_a_master_that_starts_the_drives_again_does_not_get_them(wired: Wired) -> None:
    wired.up()
    for _ in range(50):
        for frame_id, data in ((0x000, b"\x01\x00"), (0x201, b"\x0f\x00" + bytes(4))):
            wired.drives.on_frame("left", frame_id, data, wired.now_ns)
            wired.peer.on_frame("left", frame_id, data, wired.now_ns)
        wired._flush()
        wired.run(0.1)
    assert "a second master" in wired.drives.faults["neck_yaw"]
    # what NMT lets through before the next heartbeat is stopped within it
    wired.run(0.3)
    assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)


def test_one_that_has_not_begun_says_nothing_to_another_s_drives(wired: Wired) -> None:
    late = Drives(wired.config, wired.skeleton)
    for frame_id, data in ((0x080, b""), (0x701, b"\x05"), (0x201, b"\x0f\x00" + bytes(4))):
        late.on_frame("left", frame_id, data, wired.now_ns)
    assert late.outbox == []
    late.start(wired.now_ns)
    assert late.outbox == []
    assert "SYNC, targets (RPDO) for node 1 (neck_yaw)" in late.second_master.words
