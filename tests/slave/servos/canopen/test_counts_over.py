"""A drive whose position counts over at ±2³¹: neither its angle nor its joint jumps there."""

from __future__ import annotations

import numpy as np
import pytest

from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.units import DriveUnits, counted_over
from tests.slave.servos.canopen.conftest import Wired

NURSING = load_skeleton("nursing")
JOINT = "left_elbow_pitch"
INDEX = NURSING.joint_names.index(JOINT)
END = 2**31


def config(zero: int, *, counts_over: bool = True, reversed_: bool = False) -> CanopenConfig:
    """A drive whose position is `zero` where its joint's angle is 0."""
    drives = CanopenConfig().drives_of(NURSING)
    changes = {
        "zero_increments": zero,
        "counts_over": counts_over,
        "gear_ratio": 100.0,
        "reversed": reversed_,
    }
    drives[JOINT] = drives[JOINT].model_copy(update=changes)
    return CanopenConfig(drives=drives)


@pytest.mark.parametrize(("zero", "reversed_"), [(END - 1000, False), (-END + 1000, True)])
def test_one_increment_beyond_the_last_is_one_increment(zero: int, reversed_: bool) -> None:
    units = DriveUnits.of(config(zero, reversed_=reversed_), NURSING)
    step_rad = 1.0 / units.scale[INDEX]
    shown = np.zeros((3, 25), np.int32)
    shown[:, INDEX] = [END - 2, END - 1, -END]
    angles = np.array([units.angle_rad(row)[INDEX] for row in shown])
    assert np.diff(angles) == pytest.approx([step_rad, step_rad], rel=1e-6)
    for row, angle in zip(shown, angles, strict=True):
        sent = units.increments(np.where(np.arange(25) == INDEX, angle, 0.0))
        assert sent[INDEX] == row[INDEX]
        assert sent.astype(np.int32)[INDEX] == row[INDEX]


def test_every_angle_of_the_range_comes_back() -> None:
    units = DriveUnits.of(config(END - 5_000_000), NURSING)
    lower, upper = units.limits_rad[INDEX]
    for angle in np.linspace(lower, upper, 1001):
        sent = units.increments(np.full(25, angle))
        assert -END <= sent[INDEX] < END
        back = units.angle_rad(np.clip(sent, -END, END - 1).astype(np.int32))
        assert back[INDEX] == pytest.approx(angle, abs=1.0 / abs(units.scale[INDEX]))


def test_what_32_bits_show_at_their_ends() -> None:
    shown = counted_over(np.array([END - 1.0, END, END + 1.0, -END, -END - 1.0]))
    assert shown.tolist() == [END - 1, -END, -END + 1, -END, END - 1]


def robot(zero: int) -> Wired:
    wired = Wired(config(zero))
    wired.up()
    wired.setpoint = wired.read_rad()
    wired.run(0.5)
    return wired


def moved_through(wired: Wired) -> np.ndarray:
    """Angles of the joint by its drive, while it moves by 40° within two seconds."""
    begin = np.array(wired.setpoint)
    seen = []
    for share in np.linspace(0.0, 1.0, 100):
        wired.setpoint = begin.copy()
        wired.setpoint[INDEX] = begin[INDEX] + share * np.radians(40.0)
        wired.run(0.02)
        drive_rad = wired.drives.reading.drive_rad
        assert drive_rad is not None
        seen.append(drive_rad[INDEX])
    return np.array(seen)


@pytest.mark.parametrize("zero", [0, END - 300_000])
def test_a_joint_moves_through_that_point_as_through_any_other(zero: int) -> None:
    wired = robot(zero)
    seen = moved_through(wired)
    assert not wired.drives.faults
    assert np.degrees(seen[-1] - seen[0]) == pytest.approx(40.0, abs=2.5)
    assert np.abs(np.diff(seen)).max() < np.radians(2.0)
    true = np.array(wired.positions)[:, INDEX]
    assert np.abs(np.diff(true)).max() < np.radians(0.5)
    shown = wired.peer.drives[INDEX].position
    assert (shown < 0) is (zero != 0), "it has gone over"


def test_such_a_drive_is_told_no_software_limits_which_is_said() -> None:
    wired = robot(END - 300_000)
    assert "607Dh" in wired.drives.left_out[JOINT]


def test_without_the_key_such_a_range_is_refused() -> None:
    with pytest.raises(ConfigError, match="counts_over = true") as refused:
        raise ConfigError(
            "slave.toml", config(END - 300_000, counts_over=False).mistakes_for(NURSING, EncoderConfig())
        )
    assert f"{JOINT}.gear_ratio" in str(refused.value)
    assert not config(END - 300_000).mistakes_for(NURSING, EncoderConfig())
