from datetime import date

import numpy as np
import pytest

from common.quaternion import Array
from deploy.sim.suit.imperfections import Imperfections
from master.calibrate.magnetic import calibrate_magnetic
from master.calibrate.recording import NodeRecording, RecordingError

RATE_HZ = 50.0
FIELD_UT = 49.0


def free_rotation(seconds: float = 90.0, reach: float = 1.0) -> Array:
    """The field's direction in a node that is turned about, times its strength; `reach` < 1 stays near z."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    # a spiral from pole to pole and back, its turns apart by less than a cell
    polar = reach * np.pi * (0.5 - 0.5 * np.cos(2 * np.pi * t / 90.0))
    azimuth = 2 * np.pi * t / 7.3
    sine = np.sin(polar)
    out: Array = FIELD_UT * np.column_stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)])
    return out


def recorded(mag: Array | None) -> NodeRecording:
    rest = np.zeros((9000 if mag is None else len(mag), 3))
    return NodeRecording("unit", RATE_HZ, rest, rest, mag)


def as_delivered(truth: Array, seed: int) -> Array:
    """What an HMC5883 of the raw grade reads, hard iron and all."""
    unit = Imperfections("raw", 1, seed)
    rows = np.concatenate([np.zeros((len(truth), 6)), truth], axis=1)
    return np.concatenate([unit.apply(row[None])[:, 6:] for row in rows])


@pytest.mark.parametrize("seed", range(3))
def test_the_spread_held_out_is_that_of_the_noise(seed: int) -> None:
    truth = free_rotation(180.0)
    found = calibrate_magnetic(recorded(as_delivered(truth, seed)))
    assert found.hold_out_spread_ut / found.fit.field_ut <= 0.007
    assert found.spread_before_ut > 5 * found.spread_after_ut
    assert found.coverage > 0.9
    (note,) = found.notes
    assert "calibrate imu first" in note


def test_what_is_held_out_was_not_fitted_to() -> None:
    """With a field that differs from place to place every fit is a compromise, and the next place off it."""
    truth = free_rotation(60.0)
    room = np.array([1.0 + 0.02 * np.sin(k) for k in range(6)]).repeat(len(truth) // 6)[:, None]
    found = calibrate_magnetic(recorded(as_delivered(truth * room, 3)))
    assert found.hold_out_spread_ut > 1.03 * found.spread_after_ut


def test_directions_come_out_as_they_should() -> None:
    truth = free_rotation()
    raw = as_delivered(truth, 0)
    affine, made = calibrate_magnetic(recorded(raw)).parts(date(2026, 1, 2), "m.npz")["magnetometer"]
    out = raw @ affine[:, :3].T + affine[:, 3]
    cosine = np.sum(out * truth, axis=1) / np.linalg.norm(out, axis=1) / FIELD_UT
    # what is left is the noise, and what no ellipsoid can tell: how the unit sits on its board
    assert np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))) < 0.6
    assert made.unit == "µT"
    assert made.hold_out is not None


def test_missing_samples_are_left_out() -> None:
    mag = as_delivered(free_rotation(), 0)
    mag[::20] = np.nan
    found = calibrate_magnetic(recorded(mag))
    assert len(found.readings_ut) == np.isfinite(mag).all(axis=1).sum()


@pytest.mark.parametrize("reach", [0.1, 0.25, 0.4])
def test_too_little_of_the_sphere_is_refused(reach: float) -> None:
    with pytest.raises(RecordingError, match=r"covered too thinly.*turn the node"):
        calibrate_magnetic(recorded(as_delivered(free_rotation(reach=reach), 1)))


def test_the_share_seen_is_said() -> None:
    with pytest.raises(RecordingError, match=r"covered too thinly: 3\d % of it was seen, at least 50 %"):
        calibrate_magnetic(recorded(as_delivered(free_rotation(180.0, reach=0.4), 1)))


@pytest.mark.parametrize("noise_ut", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_half_of_the_sphere_is_enough_and_stated_less_sure(noise_ut: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    half, side, noise = rng.normal(size=(16000, 3)), rng.normal(size=3), rng.normal(size=(16000, 3))
    half *= FIELD_UT / np.linalg.norm(half, axis=1, keepdims=True)
    half *= np.sign(half @ side)[:, None]
    whole = half * np.where(np.arange(16000) % 2, 1.0, -1.0)[:, None]
    hard, soft = np.array([12.0, -7.0, 20.0]), np.array([1.05, 0.97, 1.0])
    found, surer = (calibrate_magnetic(recorded(v * soft + hard + noise_ut * noise)) for v in (half, whole))
    assert np.linalg.norm(found.fit.centre - hard) < 0.5
    assert np.all(np.abs(found.affine[:, 3] + found.affine[:, :3] @ hard) < 4.0 * found.sigma[:, 3])
    assert found.sigma[:, 3].max() > 2.0 * surer.sigma[:, 3].max()
    assert any("the hard iron is known to ±" in note for note in found.notes)


def test_a_side_that_noise_hides_is_refused() -> None:
    upper = np.random.default_rng(0).normal(size=(200, 3))
    upper *= FIELD_UT / np.linalg.norm(upper, axis=1, keepdims=True)
    upper[:, 2] = np.abs(upper[:, 2])
    noise = np.random.default_rng(1).normal(size=upper.shape)
    with pytest.raises(RecordingError, match="one side of it was not seen"):
        calibrate_magnetic(recorded(upper + 4.0 * noise))


def test_less_of_the_sphere_than_is_good_is_said() -> None:
    found = calibrate_magnetic(recorded(as_delivered(free_rotation(reach=0.6), 1)))
    assert any("of the sphere seen" in note for note in found.notes)


def clipped(mag: Array) -> Array:
    out: Array = np.clip(mag, -30.0, 30.0)
    return out


def constant(mag: Array) -> Array:
    return mag * [1.0, 1.0, 0.0]


def gaps(mag: Array) -> Array:
    return np.where(np.arange(len(mag))[:, None] % 4 == 0, np.nan, mag)


def disturbed(mag: Array) -> Array:
    t = np.arange(len(mag))[:, None] / RATE_HZ
    out: Array = mag + 25.0 * np.sin(t * [0.3, 0.5, 0.7])
    return out


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (clipped, "magnetometer is clipped on"),
        (constant, "reads the same all along on z"),
        (gaps, "25 % of the magnetometer's readings are missing"),
        (disturbed, "it was disturbed"),
        (lambda mag: mag[:60], "too few"),
        (lambda mag: 0.01 * mag, r"0\.49 µT strong, .* are the readings in µT"),
        (lambda mag: 10.0 * mag, r"are the readings in µT\? 1 gauss is 100 µT"),
    ],
)
def test_what_cannot_be_calibrated_from_is_refused(spoil, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RecordingError, match=message):
        calibrate_magnetic(recorded(spoil(free_rotation())))


@pytest.mark.parametrize("limit_ut", [10.0, 200.0])
def test_the_weakest_and_strongest_field_that_a_room_can_have(limit_ut: float) -> None:
    beyond = 0.98 if limit_ut < 50.0 else 1.02
    there = free_rotation() * (limit_ut / FIELD_UT)
    calibrate_magnetic(recorded(there / beyond))
    with pytest.raises(RecordingError, match="are the readings in µT"):
        calibrate_magnetic(recorded(there * beyond))


def test_a_node_without_a_magnetometer_is_refused() -> None:
    with pytest.raises(RecordingError, match="no magnetometer"):
        calibrate_magnetic(recorded(None))
