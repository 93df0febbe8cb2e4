"""Torque limits over the wire: what a drive is told, and that the simulated motor gives no more."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig, EffortSource, TorqueLimitBy
from tests.slave.servos.canopen.conftest import Wired

ROLL = "left_shoulder_roll"
NURSING = load_skeleton("nursing")
J = len(NURSING.joints)
BOTH = TorqueLimitBy.BOTH_DIRECTIONS


def limited(by: TorqueLimitBy = BOTH, **changes: object) -> CanopenConfig:
    """One drive, with a gear of 100, takes a torque limit."""
    plain = CanopenConfig()
    drives = plain.drives_of(NURSING)
    settings = {"gear_ratio": 100.0, "torque_limit": by, "most_torque_percent": 300.0, **changes}
    drives[ROLL] = drives[ROLL].model_copy(update=settings)
    return plain.model_copy(update={"drives": drives})


def ranges(least_nm: float, most_nm: float) -> Array:
    return np.stack((np.full(J, least_nm), np.full(J, most_nm)))


def told_nm(wired: Wired) -> tuple[float, float]:
    """What the simulated motor may give at the joint."""
    low, high = wired.peer._torque.limit_nm[:, wired.index(ROLL)]
    return float(low), float(high)


def thousandth_nm(wired: Wired) -> float:
    return 1e-6 * wired.peer.drives[wired.index(ROLL)].rated_torque_mnm * 100.0


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("by", [BOTH, TorqueLimitBy.MAX_TORQUE])
def test_the_greater_direction_is_written_for_both(by: TorqueLimitBy, reverse: bool) -> None:
    wired = Wired(limited(by, reversed=reverse))
    wired.up()
    wired.torque_nm = ranges(-3.0, 5.0)
    wired.run(0.1)
    low, high = told_nm(wired)
    assert 5.0 <= high <= 5.0 + thousandth_nm(wired)
    assert low == -high
    others = np.delete(wired.peer._torque.limit_nm, wired.index(ROLL), axis=1)
    assert np.isinf(others).all(), "drives that are not asked keep what they have"
    assert set(wired.drives.no_torque_limit) == set(NURSING.joint_names) - {ROLL}
    assert not wired.drives.faults


def test_a_drive_never_gets_more_than_its_most_and_all_of_it_where_nothing_limits_it() -> None:
    wired = Wired(limited(most_torque_percent=200.0))
    wired.up()
    most_nm = 2000.0 * thousandth_nm(wired)
    for torque_nm in (None, ranges(-1e6, 1e6), ranges(-np.inf, np.inf)):
        wired.torque_nm = ranges(-1.0, 1.0)
        wired.run(0.1)
        assert told_nm(wired)[1] < 0.5 * most_nm
        wired.torque_nm = torque_nm
        wired.run(0.1)
        assert told_nm(wired) == pytest.approx((-most_nm, most_nm))


def test_to_stop_a_drive_has_all_its_torque() -> None:
    wired = Wired(limited())
    wired.up()
    wired.torque_nm = ranges(-1.0, 1.0)
    wired.run(0.1)
    assert told_nm(wired)[1] < 1.1
    wired.drives.stop()
    wired.run(0.03)
    assert told_nm(wired)[1] == pytest.approx(3000.0 * thousandth_nm(wired))


def sagged_rad(torque_nm: Array | None) -> float:
    """How far an arm that is held out sideways sinks within half a second."""
    wired = Wired(limited())
    wired.up()
    posture = wired.read_rad().copy()
    posture[wired.index(ROLL)] = 1.0
    wired.setpoint = posture
    wired.run(6.0)
    before = wired.peer.plant.position_rad[wired.index(ROLL)]
    wired.torque_nm = torque_nm
    wired.run(0.3)
    return float(before - wired.peer.plant.position_rad[wired.index(ROLL)])


def test_the_simulated_motor_gives_no_more_than_it_was_told() -> None:
    assert abs(sagged_rad(None)) < 0.005
    assert sagged_rad(ranges(-0.1, 0.1)) > 0.02


@pytest.mark.parametrize(
    ("lacks", "said"),
    [
        (0x60E1, "its drive takes none (object 60E1:0: there is no such object)"),
        (0x1401, "its drive takes none (object 1401:1: there is no such object)"),
        (0x6076, "its drive has no rated torque (6076h): set rated_torque_nm"),
    ],
)
def test_a_drive_that_cannot_take_it_is_left_out_and_said(lacks: int, said: str) -> None:
    wired = Wired(limited())
    wired.peer.drives[wired.index(ROLL)].traits.lacks |= {lacks}
    wired.up()
    wired.torque_nm = ranges(-1.0, 1.0)
    wired.run(0.2)
    assert wired.drives.no_torque_limit[ROLL] == said
    assert told_nm(wired)[1] > 20.0
    assert not wired.drives.faults


def test_the_rated_torque_is_asked_for_where_no_effort_is() -> None:
    wired = Wired(limited(effort=EffortSource.NONE))
    wired.up()
    assert ROLL not in wired.drives.no_torque_limit


def test_what_a_dead_slave_left_behind_is_raised_again_at_the_next_start() -> None:
    wired = Wired(limited())
    wired.up()
    wired.torque_nm = ranges(-1.0, 1.0)
    wired.run(0.1)
    wired.alive = False
    wired.run(1.0)
    assert told_nm(wired)[1] < 1.1
    wired.alive, wired.torque_nm = True, None
    wired.up()
    wired.run(0.1)
    assert told_nm(wired)[1] == pytest.approx(3000.0 * thousandth_nm(wired))


def test_a_drive_whose_slave_dies_brakes_with_what_it_was_told_last() -> None:
    """That is the price of a limit. At this speed the way to standstill is no longer by it."""
    ways = []
    for torque_nm in (None, ranges(-12.0, 12.0)):
        wired = Wired(limited())
        wired.up()
        posture = wired.read_rad().copy()
        wired.setpoint, j = posture, wired.index(ROLL)
        wired.run(1.0)
        wired.torque_nm = torque_nm
        for _ in range(60):
            posture[j] += 0.01
            wired.run(0.02)
        wired.alive = False
        begin = wired.peer.plant.position_rad[j]
        wired.run(1.0)
        ways.append(float(wired.peer.plant.position_rad[j] - begin))
        assert abs(wired.speed_rad_s(0.1)[:, j]).max() < 0.01
    assert ways[0] > 0.01
    assert ways[1] == pytest.approx(ways[0], abs=0.01)


def test_a_bus_that_cannot_carry_the_limits_is_refused() -> None:
    plain = CanopenConfig(sync_hz=200)
    before = plain.load(NURSING)
    drives = {
        name: drive.model_copy(update={"torque_limit": BOTH, "most_torque_percent": 300.0})
        for name, drive in plain.drives_of(NURSING).items()
    }
    after = plain.model_copy(update={"drives": drives, "effort_every": 10}).load(NURSING)
    assert all(after[name][1] > before[name][1] for name in before)


def test_a_limit_without_the_drive_s_most_is_refused() -> None:
    (mistake,) = limited(most_torque_percent=None).mistakes_for(NURSING, EncoderConfig())
    assert mistake.key == f"servos.canopen.drives.{ROLL}.most_torque_percent"
    assert limited().mistakes_for(NURSING, EncoderConfig()) == []


@pytest.mark.parametrize("word", ["60E0h", "6072h", "none"])
def test_a_file_names_the_object(word: str) -> None:
    drive = DriveConfig.model_validate({"id": 1, "bus": "left", "torque_limit": word})
    assert drive.torque_limit.value == word
