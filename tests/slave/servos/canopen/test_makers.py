"""Drives as five makers build them: each comes up, moves, stops; what it lacks is told, or refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.makers import (
    MAKERS,
    Maker,
    deaf,
    epos,
    fixed,
    interpolating,
    maker_of,
    without_position_mode,
)
from deploy.sim.drives.mixture import SAYS
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig
from tests.slave.servos.canopen.conftest import Wired

NURSING = load_skeleton("nursing")
JOINT = "left_elbow_pitch"


def robot(kinds: Mapping[str, str]) -> Wired:
    """Drives of makers' kinds by joint; all others are tandem's own."""
    plain = CanopenConfig().drives_of(NURSING)
    drives = {
        name: drive.model_copy(update={"encoder": None, **SAYS[kinds[name]]}) if name in kinds else drive
        for name, drive in plain.items()
    }
    wired = Wired(CanopenConfig(drives=drives))
    for name, kind in kinds.items():
        wired.peer.build(name, MAKERS[kind])
    return wired


def one(maker: Maker, **says: object) -> Wired:
    """One drive of a kind, and what the file says of it."""
    drives = CanopenConfig().drives_of(NURSING)
    drives[JOINT] = drives[JOINT].model_copy(update={"encoder": None, **says})
    wired = Wired(CanopenConfig(drives=drives))
    wired.peer.build(JOINT, maker)
    return wired


def refusal(wired: Wired, seconds: float = 2.0) -> str:
    wired.start()
    wired.until(lambda: wired.drives.failed, seconds)
    return wired.drives.not_running[JOINT]


@pytest.fixture(scope="module")
def mixed() -> Wired:
    names = list(MAKERS)
    wired = robot({joint: names[i % 5] for i, joint in enumerate(NURSING.joint_names)})
    wired.start()
    wired.until(lambda: wired.drives.running, 15.0)
    return wired


def by_kind(wired: Wired, kind: str) -> list[int]:
    return [i for i in range(25) if list(MAKERS)[i % 5] == kind]


def test_five_makers_drives_come_up_in_one_robot_and_follow(mixed: Wired) -> None:
    assert dict(mixed.drives.faults) == {}
    assert all(drive.state is Power.ENABLED for drive in mixed.peer.drives)
    mixed.setpoint = np.clip(np.full(25, 0.2), NURSING.lower_rad, NURSING.upper_rad)
    mixed.run(2.5)
    assert np.abs(mixed.read_rad() - mixed.setpoint).max() < 0.006
    assert mixed.drives.reading.valid.all()
    assert mixed.drives.unknown == 0


def test_each_is_led_by_what_it_has(mixed: Wired) -> None:
    modes = [drive.mode for drive in mixed.peer.drives]
    assert [modes[i] for i in range(5)] == [8, 7, 8, 8, 8]
    guarded = [drive._master.guard_ns > 0 for drive in mixed.peer.drives]
    assert guarded == [i in by_kind(mixed, "interpolating") for i in range(25)]


def test_what_is_left_out_is_told_by_joint(mixed: Wired) -> None:
    told = mixed.drives.left_out
    names = NURSING.joint_names
    assert set(told) == set(names)
    assert "6065h and 6066h" in told[names[0]]
    assert "node guarding takes their place" in told[names[1]]
    assert "607Dh: no software limits" in told[names[1]]
    assert "60C2h" not in told[names[1]]
    assert "used as they are" in told[names[2]]
    assert "605Ah" in told[names[3]]
    assert told[names[4]] == "607Dh: no software limits of its own; the guard's hold"


def test_a_drive_without_torque_runs_and_says_no_contact_detection(mixed: Wired) -> None:
    silent = {NURSING.joint_names[i] for i in (*by_kind(mixed, "interpolating"), *by_kind(mixed, "fixed"))}
    assert set(mixed.drives.no_effort) == silent
    effort = mixed.drives.reading.effort_nm
    assert effort is not None
    assert {name for name, nm in zip(NURSING.joint_names, effort, strict=True) if np.isnan(nm)} == silent


def test_all_of_them_stop_for_an_estop_and_come_back(mixed: Wired) -> None:
    mixed.drives.stop()
    mixed.run(0.6)
    assert not any(drive.state is Power.ENABLED for drive in mixed.peer.drives)
    mixed.drives.release(mixed.now_ns)
    mixed._flush()
    mixed.until(lambda: mixed.drives.running, 4.0)
    assert dict(mixed.drives.faults) == {}


def test_all_of_them_notice_that_the_slave_has_died() -> None:
    names = list(MAKERS)
    wired = robot({joint: names[i % 5] for i, joint in enumerate(NURSING.joint_names[:5])})
    wired.start()
    wired.until(lambda: wired.drives.running, 15.0)
    wired.alive = False
    wired.run(0.35)
    assert not any(drive.state is Power.ENABLED for drive in wired.peer.drives)


# what is refused


@pytest.mark.parametrize(
    ("maker", "says", "said"),
    [
        (
            without_position_mode,
            {},
            "neither cyclic synchronous position mode (8) nor interpolated position mode (7), by 6502h = 0xe",
        ),
        (deaf, {}, "cannot notice that the slave has died: it has neither heartbeats (object 1016:1"),
        (fixed, {}, "lacks 6007h (object 6007:0: there is no such object): it may let the joint go"),
        (interpolating, {}, "with a brake or a self-locking gear, set holds_itself = true"),
        (interpolating, {"mode": 8, "holds_itself": True}, "has mode 7 only, by 6502h = 0x65: set mode = 7"),
        (
            lambda node: replace(interpolating(node), lacks=interpolating(node).lacks | {0x60C2}),
            {"holds_itself": True},
            "cannot interpolate: it does not take the SYNC period (object 60C2:1:",
        ),
        (
            lambda node: replace(fixed(node), lacks=fixed(node).lacks | {0x1402, 0x1602}),
            {"holds_itself": True},
            "and none of its own takes controlword and target: map them in PDO 1",
        ),
        (
            lambda node: replace(fixed(node), read_only=fixed(node).read_only | {0x1802}),
            {"holds_itself": True},
            "does not answer each SYNC (object 1802:2: cannot be written): set its TPDO's transmission type",
        ),
        (
            lambda node: replace(epos(node), homed=False),
            {"homed": True},
            "homed since it was switched on (bit 12; home it first) expected",
        ),
    ],
)
def test_what_safety_needs_and_is_missing_is_refused(
    maker: Maker, says: dict[str, object], said: str
) -> None:
    assert said in refusal(one(maker, **says), 6.0)


def test_a_homed_drive_is_taken_after_it_was_asked() -> None:
    wired = one(epos, homed=True)
    wired.start()
    wired.until(lambda: wired.drives.running, 4.0)
    assert wired.peer.drives[wired.index(JOINT)].mode == 8


def test_reserved_bits_stop_a_drive_unless_the_file_says_so() -> None:
    wired = one(MAKERS["reserved-bits"])
    wired.start()
    wired.until(lambda: wired.drives.failed, 2.0)
    assert "under local control" in wired.drives.not_running[JOINT]


def test_a_fixed_drive_that_faults_is_named_and_reset_on_an_edge() -> None:
    wired = robot({JOINT: "fixed"})
    wired.start()
    wired.until(lambda: wired.drives.running, 4.0)
    wired.happen(JOINT, DriveFault.OVER_CURRENT)
    wired.run(0.3)
    assert "over-current at the output" in wired.drives.faults[JOINT]
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 4.0)


def test_a_guarded_drive_that_falls_silent_is_named() -> None:
    wired = robot({JOINT: "interpolating"})
    wired.start()
    wired.until(lambda: wired.drives.running, 6.0)
    wired.happen(JOINT, DriveFault.SILENT)
    wired.run(0.6)
    assert wired.drives.faults[JOINT] == "silent: neither heartbeat nor position"


@pytest.mark.parametrize("text", ["left_elbow_pitch", "left_elbow_pitch=own", "wing=fixed"])
def test_a_maker_that_cannot_be_is_refused(text: str) -> None:
    assert maker_of("neck_yaw=fixed", NURSING) == ("neck_yaw", fixed)
    with pytest.raises(ConfigError, match="--maker = "):
        maker_of(text, NURSING)


def test_joints_without_an_output_encoder_are_of_a_single_reading() -> None:
    drives = CanopenConfig().drives_of(NURSING)
    drives[JOINT] = DriveConfig(id=drives[JOINT].id, bus=drives[JOINT].bus)
    assert CanopenConfig(drives=drives).single_reading(NURSING) == [JOINT]
    assert CanopenConfig().single_reading(NURSING) == []
