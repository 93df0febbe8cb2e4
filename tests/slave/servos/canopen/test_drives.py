"""The pure drives against the simulated drives, on a virtual clock."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.traits import Traits
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from tests.slave.servos.canopen.conftest import Wired

ELBOW = "left_elbow_pitch"


def small_posture(wired: Wired, rad: float = 0.2) -> Array:
    skeleton = wired.skeleton
    posture: Array = np.clip(np.full(25, rad), skeleton.lower_rad, skeleton.upper_rad)
    return posture


def test_all_drives_come_up_and_nothing_moves(wired: Wired) -> None:
    wired.up()
    assert dict(wired.drives.faults) == {}
    assert all(drive.state is Power.ENABLED for drive in wired.peer.drives)
    wired.run(0.5)
    assert wired.drives.reading.valid.all()
    assert np.abs(wired.speed_rad_s(0.5)).max() < 0.02
    assert wired.drives.unanswered == 0
    assert wired.drives.unknown == 0


@pytest.mark.parametrize("sync_hz", [50, 100])
def test_a_setpoint_is_reached_with_gears_directions_and_zeros(sync_hz: int) -> None:
    plain = CanopenConfig(sync_hz=sync_hz)
    probe = Wired(plain)
    drives = {
        name: drive.model_copy(
            update={"gear_ratio": 1.0 + 7.3 * i, "reversed": i % 2 == 1, "zero_increments": 1000 * i - 9000}
        )
        for i, (name, drive) in enumerate(plain.drives_of(probe.skeleton).items())
    }
    encoders = EncoderConfig(zero_counts={ELBOW: 4000}, reversed=[ELBOW, "neck_yaw"])
    wired = Wired(plain.model_copy(update={"drives": drives}), encoders)
    assert wired.config.mistakes_for(wired.skeleton, EncoderConfig()) == []
    wired.up()
    wired.setpoint = small_posture(wired)
    wired.run(2.5)
    # the robot sags a little under its own weight; a count is 0.0015 rad
    assert np.abs(wired.read_rad() - wired.setpoint).max() < 0.006


def test_a_drive_joins_a_far_setpoint_slowly_then_follows_exactly(wired: Wired) -> None:
    wired.up()
    wired.setpoint = small_posture(wired, 0.4)
    wired.run(0.4)
    fastest = np.abs(wired.speed_rad_s(0.4)).max()
    assert fastest < 1.3 * np.radians(wired.config.join_deg_s)
    wired.run(2.5)
    wired.setpoint = wired.setpoint - 0.05
    wired.run(0.3)
    assert np.abs(wired.read_rad() - np.maximum(wired.setpoint, wired.skeleton.lower_rad)).max() < 0.006


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (DriveFault.OVER_CURRENT, "drive fault; over-current at the output (code 2310, current)"),
        (DriveFault.OVER_TEMPERATURE, "drive fault; over-temperature of the motor (code 4310, temperature)"),
        (DriveFault.SILENT, "silent: neither heartbeat nor position"),
        (DriveFault.RESTART, "has restarted"),
    ],
)
def test_a_failed_drive_is_named_and_only_release_brings_it_back(
    wired: Wired, fault: DriveFault, said: str
) -> None:
    wired.up()
    joint = wired.index(ELBOW)
    wired.happen(ELBOW, fault)
    wired.until(lambda: ELBOW in wired.drives.faults, 0.5)
    wired.run(0.1)
    assert dict(wired.drives.faults) == {ELBOW: said}
    wired.happen(ELBOW, DriveFault.NONE)
    stood = wired.peer.plant.position_rad[joint]
    wired.setpoint = small_posture(wired)
    wired.run(1.0)
    assert ELBOW in wired.drives.faults
    assert wired.peer.drives[joint].state is not Power.ENABLED
    assert abs(wired.peer.plant.position_rad[joint] - stood) < 0.01

    wired.drives.release(wired.now_ns)
    wired._flush()
    assert "is being enabled" in wired.drives.faults[ELBOW]
    wired.until(lambda: wired.drives.running, 1.0)
    assert dict(wired.drives.faults) == {}
    wired.run(1.5)
    assert np.abs(wired.read_rad() - wired.setpoint).max() < 0.006


def test_a_fault_is_not_reset_where_that_is_forbidden() -> None:
    wired = Wired(CanopenConfig(fault_reset=False))
    wired.up()
    wired.happen(ELBOW, DriveFault.OVER_CURRENT)
    wired.run(0.2)
    wired.drives.release(wired.now_ns)
    wired.run(0.3)
    assert "cannot be enabled: it is in fault" in wired.drives.faults[ELBOW]
    assert wired.peer.drives[wired.index(ELBOW)].state is Power.FAULT


@pytest.mark.parametrize(
    ("fault", "said"),
    [(DriveFault.MAGNET_LOST, "encoder: magnet lost"), (DriveFault.PARITY, "encoder: parity error")],
)
def test_an_encoder_that_warns_is_not_valid_until_it_is_well_again(
    wired: Wired, fault: DriveFault, said: str
) -> None:
    wired.up()
    joint = wired.index(ELBOW)
    wired.happen(ELBOW, fault)
    wired.run(0.05)
    assert dict(wired.drives.faults) == {ELBOW: said}
    assert np.flatnonzero(~wired.drives.reading.valid).tolist() == [joint]
    wired.happen(ELBOW, DriveFault.NONE)
    wired.run(0.05)
    assert dict(wired.drives.faults) == {}
    assert wired.drives.reading.valid.all()


def test_a_stuck_encoder_is_found_within_two_degrees(wired: Wired) -> None:
    wired.up()
    wired.happen(ELBOW, DriveFault.ENCODER_STUCK)
    before = wired.read_rad()
    wired.setpoint = small_posture(wired)
    wired.run(1.5)
    joint = wired.index(ELBOW)
    assert wired.read_rad()[joint] == before[joint]
    assert np.degrees(wired.peer.plant.position_rad[joint]) < 4.0
    assert "its output encoder 0.0°" in wired.drives.faults[ELBOW]


def test_quick_stop_brakes_all_and_holds_whatever_is_written(wired: Wired) -> None:
    wired.up()
    wired.setpoint = small_posture(wired)
    wired.run(2.0)
    wired.setpoint = small_posture(wired, 0.35)
    wired.drives.stop()
    wired.run(0.5)
    assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
    assert dict(wired.drives.faults) == {}
    assert np.abs(wired.read_rad() - small_posture(wired)).max() < 0.03
    wired.run(0.3)
    assert np.abs(wired.speed_rad_s(0.2)).max() < 0.02

    wired.drives.release(wired.now_ns)
    wired.until(lambda: wired.drives.running, 0.5)
    wired.run(1.5)
    assert np.abs(wired.read_rad() - wired.setpoint).max() < 0.006
    assert np.abs(wired.speed_rad_s(1.5)).max() < 1.5 * np.radians(wired.config.join_deg_s)


def test_a_dead_slave_leaves_drives_that_stop_by_themselves_and_hold(wired: Wired) -> None:
    wired.up()
    middle = small_posture(wired, 0.0)
    wired.setpoint = middle
    wired.run(0.2)
    # moving at 1 rad/s when the slave dies
    for _ in range(20):
        wired.setpoint = np.clip(wired.setpoint + 0.02, wired.skeleton.lower_rad, wired.skeleton.upper_rad)
        wired.run(0.02)
    wired.alive = False
    wired.run(wired.config.dead_ms / 1000 + 0.02)
    assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
    wired.run(0.5)
    stood = wired.peer.plant.position_rad
    wired.run(0.3)
    assert np.abs(wired.peer.plant.position_rad - stood).max() < 0.005
    # a slave that lives again finds them holding, and says why
    wired.alive = True
    wired.run(0.2)
    assert len(wired.drives.faults) == 25
    assert "has left operation by itself: quick stop active" in wired.drives.faults[ELBOW]


def test_a_pause_that_the_drives_did_not_survive_is_no_jump(wired: Wired) -> None:
    wired.up()
    wired.run(0.2)
    for paused_s in (0.19, 0.21, 0.25, 0.4):
        wired.alive = False
        wired.run(paused_s)
        wired.alive = True
        stood = wired.peer.plant.position_rad
        # the guard's setpoint may be elsewhere by now
        wired.setpoint = small_posture(wired, 0.3)
        wired.run(0.3)
        stopped = [drive.state is Power.QUICK_STOP for drive in wired.peer.drives]
        if any(stopped):
            assert all(stopped)
            assert len(wired.drives.faults) == 25
            assert np.abs(wired.peer.plant.position_rad - stood).max() < 0.01
        wired.setpoint = wired.read_rad()
        wired.drives.release(wired.now_ns)
        wired.until(lambda: wired.drives.running, 0.5)


def test_a_bus_cut_for_longer_than_the_drives_wait_is_no_jump(wired: Wired) -> None:
    wired.up()
    wired.run(0.2)
    wired.cut = {"left", "right"}
    wired.run(0.3)
    wired.cut = set()
    stood = wired.peer.plant.position_rad
    wired.setpoint = small_posture(wired, 0.3)
    wired.run(0.3)
    assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
    assert np.abs(wired.peer.plant.position_rad - stood).max() < 0.01
    assert len(wired.drives.faults) == 25


def test_a_following_error_is_a_fault_of_the_drive_itself() -> None:
    wired = Wired(CanopenConfig(following_error_deg=0.5, following_error_ms=20))
    wired.up()
    wired.setpoint = small_posture(wired, 0.0)
    wired.run(0.1)
    for _ in range(25):
        wired.setpoint = np.clip(wired.setpoint + 0.04, wired.skeleton.lower_rad, wired.skeleton.upper_rad)
        wired.run(0.02)
    assert "following error (code 8611" in wired.drives.faults["left_shoulder_pitch"]


def test_a_bus_that_carries_nothing_fails_its_drives_only(wired: Wired) -> None:
    wired.up()
    wired.cut.add("right")
    wired.drives.on_bus("right", "receiving failed: drives is down")
    said = dict(wired.drives.faults)
    assert set(said) == {name for name in wired.skeleton.joint_names if name.startswith("right_")}
    assert said["right_thumb"] == "bus right is down: receiving failed: drives is down"
    wired.run(1.0)
    reading = wired.drives.reading
    assert (reading.valid == [not n.startswith("right_") for n in wired.skeleton.joint_names]).all()
    wired.cut.clear()
    wired.drives.on_bus("right", "")
    wired.run(0.3)
    # heard again, but nobody has asked for it to move again
    assert wired.drives.reading.valid[wired.index("right_thumb")]
    assert "silent" in wired.drives.faults["right_thumb"]
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 1.0)


def test_a_drive_that_is_not_there_is_named_with_its_place(wired: Wired) -> None:
    wired.peer.drives[wired.index(ELBOW)].happen(DriveFault.SILENT)
    wired.start()
    wired.run(1.5)
    bus, node = wired.where(ELBOW)
    assert wired.drives.not_running == {ELBOW: f"node {node} on bus {bus} does not answer"}


def test_a_setting_that_is_refused_is_told_with_its_object(wired: Wired) -> None:
    wired.peer.drives[0].become(Traits(read_only=frozenset({0x6060})))
    wired.start()
    wired.run(0.3)
    said = wired.drives.not_running["neck_yaw"]
    assert "refuses its configuration: object 6060:0: cannot be written" in said


def test_frames_of_wrong_length_and_of_strangers_change_nothing(wired: Wired) -> None:
    wired.up()
    wired.run(0.1)
    reading = wired.drives.reading
    for frame in ((0x181, b"short"), (0x181, bytes(9)), (0x1FF, bytes(8)), (0x5FF, bytes(8)), (0x700, b"")):
        wired.drives.on_frame("left", *frame, wired.now_ns)
    wired.drives.on_frame("nowhere", 0x181, bytes(8), wired.now_ns)
    wired.drives.on_frame("left", 0x581, bytes(8), wired.now_ns)
    wired.drives.on_frame("left", 0x081, b"", wired.now_ns)
    assert wired.drives.reading is reading
    assert dict(wired.drives.faults) == {}
    assert wired.drives.unknown == 6


def test_an_emergency_without_a_fault_is_told_until_it_is_over(wired: Wired) -> None:
    wired.up()
    wired.drives.on_frame("left", 0x081, bytes.fromhex("1042090000000000"), wired.now_ns)
    assert dict(wired.drives.faults) == {"neck_yaw": "over-temperature of the drive (code 4210, temperature)"}
    wired.run(0.1)
    assert wired.drives.running
    wired.drives.on_frame("left", 0x081, bytes(8), wired.now_ns)
    assert dict(wired.drives.faults) == {}


def test_a_drive_that_restarts_while_configured_is_configured_anew(wired: Wired) -> None:
    """The heartbeat that it shall watch for among it: or it would not stop when the slave dies."""
    drives, now_ns = wired.drives, wired.now_ns
    drives.start(now_ns)
    bus, node = wired.where(ELBOW)
    request = pdo.SDO_REQUEST + node

    def asked() -> list[bytes]:
        frames, drives.outbox = drives.outbox, []
        return [data or b"" for where, frame_id, data in frames if (where, frame_id) == (bus, request)]

    first = asked()[0]
    drives.on_frame(bus, pdo.SDO_ANSWER + node, b"\x60" + first[1:4] + bytes(4), now_ns)
    assert asked() != [first]
    drives.on_frame(bus, pdo.HEARTBEAT + node, b"\x00", now_ns)
    assert asked() == [first]
