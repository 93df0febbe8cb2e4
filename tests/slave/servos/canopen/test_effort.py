"""The effort that drives tell, against the torque that the simulated motors really give."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.sim.drives.faults import DriveFault
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig, EffortSource
from tests.slave.servos.canopen.conftest import Wired

ROLL = "left_shoulder_roll"
NURSING = load_skeleton("nursing")


def geared(**changes: object) -> CanopenConfig:
    """Drives with a gear of 100; one of them with these settings besides."""
    plain = CanopenConfig()
    drives = {
        name: drive.model_copy(update={"gear_ratio": 100.0})
        for name, drive in plain.drives_of(NURSING).items()
    }
    drives[ROLL] = drives[ROLL].model_copy(update=changes)
    return plain.model_copy(update={"drives": drives})


def outstretched(wired: Wired) -> Array:
    """Both arms held out sideways, at rest: gravity's torque is on the shoulders."""
    wired.up()
    posture = wired.read_rad().copy()
    posture[wired.index(ROLL)] = posture[wired.index("right_shoulder_roll")] = 1.0
    wired.setpoint = posture
    wired.run(5.0)
    return newest(wired)


def newest(wired: Wired) -> Array:
    effort = wired.drives.reading.effort_nm
    assert effort is not None
    return effort


def tolerance_nm(wired: Wired) -> Array:
    """Five sigma of the current sensor's noise, and a step."""
    rated_nm = 1e-3 * np.array([drive.rated_torque_mnm for drive in wired.peer.drives]) * 100.0
    out: Array = rated_nm * (5 * 0.002 + 0.001)
    return out


def agrees(wired: Wired, effort: Array, joint: str = ROLL) -> bool:
    j = wired.index(joint)
    return bool(abs(effort[j] - wired.peer.plant.effort_nm[j]) <= tolerance_nm(wired)[j])


@pytest.mark.parametrize("reverse", [False, True])
def test_what_is_told_is_the_torque_at_the_joint(reverse: bool) -> None:
    wired = Wired(geared(reversed=reverse))
    effort = outstretched(wired)
    assert abs(effort[wired.index(ROLL)]) > 3.0
    assert (np.abs(effort - wired.peer.plant.effort_nm) <= tolerance_nm(wired)).all()
    assert wired.drives.no_effort == {}


@pytest.mark.parametrize(("polarity", "correct"), [(0x00, False), (0xA0, False), (0x80, False), (0x00, True)])
def test_the_sign_follows_the_drive_s_polarity(polarity: int, correct: bool) -> None:
    """0x80: position is turned round and torque is not. The last: a drive whose polarity does not say so."""
    wired = Wired(geared(effort_reversed=correct))
    wired.peer.drives[wired.index(ROLL)].traits.polarity = polarity
    effort = outstretched(wired)
    assert agrees(wired, -effort if correct else effort)


def test_a_gear_s_efficiency_lessens_what_arrives() -> None:
    wired = Wired(geared(gear_efficiency=0.7))
    drive = wired.peer.drives[wired.index(ROLL)]
    effort = outstretched(wired)
    motor_nm = 1e-6 * drive.thousandths * drive.rated_torque_mnm
    assert effort[wired.index(ROLL)] == pytest.approx(70.0 * motor_nm, rel=0.05)
    assert agrees(wired, effort)


@pytest.mark.parametrize(
    ("lacks", "said"),
    [
        (0x6077, "its drive tells none (object 6077:0: there is no such object)"),
        (0x1801, "its drive tells none (object 1801:1: there is no such object)"),
        (0x1A01, "its drive tells none (object 1A01:0: there is no such object)"),
        (0x6076, "its drive has no rated torque (6076h): set rated_torque_nm"),
    ],
)
def test_a_drive_that_cannot_tell_it_is_left_out_and_said(lacks: int, said: str) -> None:
    wired = Wired(geared())
    wired.peer.drives[wired.index(ROLL)].traits.lacks = frozenset({lacks})
    effort = outstretched(wired)
    assert np.isnan(effort).sum() == 1
    assert np.isnan(effort[wired.index(ROLL)])
    assert wired.drives.no_effort == {ROLL: said}
    assert not wired.drives.faults


def test_where_no_drive_tells_any_there_is_none() -> None:
    wired = Wired()
    for drive in wired.peer.drives:
        drive.traits.lacks = frozenset({0x6077})
    wired.up()
    wired.run(0.5)
    assert wired.drives.reading.effort_nm is None
    assert len(wired.drives.no_effort) == 25


def test_the_file_s_rated_torque_comes_before_the_drive_s() -> None:
    wired = Wired(geared(rated_torque_nm=1.0))
    drive = wired.peer.drives[wired.index(ROLL)]
    drive.traits.lacks = frozenset({0x6076})
    effort = outstretched(wired)
    assert effort[wired.index(ROLL)] == pytest.approx(0.001 * drive.thousandths * 100.0, rel=0.05)


def test_current_serves_where_there_is_no_torque() -> None:
    wired = Wired(geared(effort=EffortSource.CURRENT))
    wired.peer.drives[wired.index(ROLL)].traits.lacks = frozenset({0x6077})
    assert agrees(wired, outstretched(wired))


def test_a_file_may_want_none_and_then_nothing_is_sent_for_it() -> None:
    wired = Wired(geared(effort=EffortSource.NONE))
    effort = outstretched(wired)
    assert np.isnan(effort[wired.index(ROLL)])
    assert wired.drives.no_effort == {ROLL: 'the file says so (effort = "none")'}
    assert wired.peer.drives[wired.index(ROLL)].value(0x1801, 1) & 0x8000_0000


def test_one_key_asks_no_drive_at_all() -> None:
    quiet = geared().model_copy(update={"tell_effort": False})
    wired = Wired(quiet)
    wired.up()
    wired.run(0.2)
    assert wired.drives.reading.effort_nm is None
    assert quiet.no_effort(NURSING) == dict.fromkeys(
        NURSING.joint_names, 'the file says so (effort = "none")'
    )


@pytest.mark.parametrize("every", [1, 4])
def test_a_drive_that_stops_telling_is_known_after_three_misses(every: int) -> None:
    wired = Wired(geared().model_copy(update={"effort_every": every}))
    outstretched(wired)
    j, period_s = wired.index(ROLL), wired.config.period_ns / 1e9
    wired.happen(ROLL, DriveFault.TORQUE_SILENT)
    syncs = 0
    while not np.isnan(newest(wired)[j]):
        wired.run(period_s)
        syncs += 1
    # the last telling may have come with any of the SYNCs before
    assert 3 * every - (every - 1) <= syncs - 1 <= 3 * every
    assert wired.drives.no_effort == {ROLL: "its drive has stopped telling it"}
    assert not wired.drives.faults
    wired.happen(ROLL, DriveFault.NONE)
    wired.run(2 * every * period_s)
    assert wired.drives.no_effort == {}
    assert agrees(wired, newest(wired))


def test_a_reading_waits_for_the_efforts_of_its_own_sync() -> None:
    wired = Wired(geared())
    outstretched(wired)
    kept: list[tuple[str, int, bytes]] = []
    on_frame = wired.drives.on_frame
    bus, node = wired.where(ROLL)

    def late(name: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if (name, frame_id) == (bus, 0x280 + node):
            kept.append((name, frame_id, data))
        else:
            on_frame(name, frame_id, data, now_ns)

    wired.drives.on_frame = late  # type: ignore[method-assign, assignment]
    before_ns = wired.drives.reading.read_ns
    while not kept:
        wired.run(0.004)
    assert wired.drives.reading.read_ns == before_ns
    on_frame(bus, 0x280 + node, (1234).to_bytes(2, "little"), wired.now_ns)
    assert wired.drives.reading.read_ns > before_ns
    assert newest(wired)[wired.index(ROLL)] == pytest.approx(
        1.234 * 1e-3 * wired.peer.drives[wired.index(ROLL)].rated_torque_mnm * 100.0
    )


def test_positions_do_not_wait_longer_than_to_the_next_sync_for_an_effort_that_never_comes() -> None:
    wired = Wired(geared())
    outstretched(wired)
    wired.happen(ROLL, DriveFault.TORQUE_SILENT)
    for _ in range(10):
        wired.run(wired.config.period_ns / 1e9)
        assert wired.now_ns - wired.drives.reading.read_ns <= 2 * wired.config.period_ns
    # once it counts as lost nobody waits for it
    assert wired.now_ns - wired.drives.reading.read_ns < wired.config.period_ns


def test_a_drive_that_restarts_tells_again_after_a_reset() -> None:
    wired = Wired(geared())
    outstretched(wired)
    wired.happen(ROLL, DriveFault.RESTART)
    wired.run(0.3)
    assert np.isnan(newest(wired)[wired.index(ROLL)])
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 2.0)
    wired.run(0.2)
    assert agrees(wired, newest(wired))


def test_a_telling_of_the_wrong_length_changes_nothing() -> None:
    wired = Wired(geared())
    before = outstretched(wired)
    bus, node = wired.where(ROLL)
    unknown = wired.drives.unknown
    wired.drives.on_frame(bus, 0x280 + node, b"\x00\x00\x00", wired.now_ns)
    np.testing.assert_array_equal(newest(wired), before)
    assert wired.drives.unknown == unknown + 1


def test_effort_does_not_crowd_out_what_moves_the_drives() -> None:
    """25 drives on two buses at 200 Hz: 14 on the fuller one. At every SYNC they would fill 85 % of it."""
    fast = CanopenConfig(sync_hz=200, heartbeat_ms=20)
    assert fast.effort_syncs(NURSING) == 2
    assert [round(bits / 1e4) for _, bits in fast.load(NURSING).values()] == [76, 60]
    every = fast.model_copy(update={"effort_every": 1})
    assert [round(bits / 1e4) for _, bits in every.load(NURSING).values()] == [85, 67]
    assert CanopenConfig().effort_syncs(NURSING) == 1


def test_a_file_that_tells_it_too_often_is_refused() -> None:
    drives = {n: DriveConfig(id=i, bus="left") for i, n in enumerate(NURSING.joint_names, 1)}
    packed = CanopenConfig(sync_hz=125, heartbeat_ms=16, drives=drives)
    assert packed.effort_syncs(NURSING) == 4
    assert packed.mistakes_for(NURSING, EncoderConfig()) == []
    (mistake,) = packed.model_copy(update={"effort_every": 1}).mistakes_for(NURSING, EncoderConfig())
    assert "what bus left can carry" in mistake.expected
