"""Paper D's figures over a grid of all attitudes, with the chips' own noise and rounding, before and after
calibration on a turntable."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from common.config.sensor_calibration import NodeCalibration
from common.quaternion import Array, conjugate, rotate
from common.wire.messages import Mask
from slave.attitude.angles import (
    azimuth_rad,
    gravity_tool_face_rad,
    inclination_rad,
    magnetic_tool_face_rad,
    orientation,
)
from slave.attitude.attitude import NEAR_VERTICAL_RAD, attitude
from slave.attitude.instrument import Instrument, affine
from slave.attitude.simulated import FIELD_UT, GRAVITY_M_S2, ChipErrors, Chips, readings
from slave.attitude.smooth import Smoother
from tests.slave.attitude.turntable import fit_affine

RATE_HZ = 50
TIME_CONSTANT_S = 3.0
GRAVITY: Array = np.array([0.0, 0.0, GRAVITY_M_S2])
AS_IT_COMES = np.eye(3, 4)


def grid(*degrees: Array) -> tuple[Array, Array, Array]:
    inclination, azimuth, tool_face = (np.radians(x).ravel() for x in np.meshgrid(*degrees, indexing="ij"))
    return inclination, azimuth, tool_face


def full_grid() -> tuple[Array, Array, Array]:
    """Every 10° of inclination with both ends and their 5°, every 15° of azimuth, every 30° of tool-face."""
    inclination = np.array([0.0, 5.0, *range(10, 180, 10), 175.0, 180.0])
    return grid(inclination, np.arange(0.0, 360.0, 15.0), np.arange(0.0, 360.0, 30.0))


def settled(q: Array, chips: Chips, acc_map: Array, mag_map: Array, seed: int) -> tuple[Array, Array]:
    """Calibrated readings (K, 3) after three time constants of the instrument's smoothing, all at once."""
    rng = np.random.default_rng(seed)
    share = -math.expm1(-1.0 / (RATE_HZ * TIME_CONSTANT_S))
    up = field = np.zeros((len(q), 3))
    for n in range(int(3 * TIME_CONSTANT_S * RATE_HZ)):
        acc, mag = readings(q, rng, chips)
        now = max(share, 1.0 / (n + 1))
        up = up + now * (affine(acc_map, acc) - up)
        field = field + now * (affine(mag_map, mag) - field)
    return up, field


def as_soldered(rng: np.random.Generator) -> Chips:
    """Two chips out of the box: ±5 % of scale, 1° askew, up to 0.1 g of offset; iron near by, up to 10 µT."""

    def matrix() -> Array:
        out: Array = np.eye(3) + np.diag(rng.uniform(-0.05, 0.05, 3)) + rng.uniform(-0.02, 0.02, (3, 3))
        return out

    return Chips(
        ChipErrors(matrix(), rng.uniform(-0.1, 0.1, 3) * GRAVITY_M_S2),
        ChipErrors(matrix(), rng.uniform(-10.0, 10.0, 3)),
    )


@dataclass(frozen=True)
class Worst:
    """Largest errors over the grid, °."""

    inclination: float
    azimuth: float
    gravity_tool_face: float
    magnetic_tool_face: float


def worst(at: tuple[Array, Array, Array], up: Array, field: Array) -> Worst:
    inclination, azimuth, tool_face = at
    q = orientation(*at)
    upright = np.minimum(inclination, np.pi - inclination) < NEAR_VERTICAL_RAD - 1e-9

    def largest(found: Array, truth: Array, where: Mask) -> float:
        return math.degrees(np.abs((found - truth + np.pi) % (2.0 * np.pi) - np.pi)[where].max())

    everywhere = np.ones_like(upright)
    true_field = magnetic_tool_face_rad(rotate(conjugate(q), FIELD_UT))
    return Worst(
        largest(inclination_rad(up), inclination, everywhere),
        largest(azimuth_rad(up, field), azimuth, ~upright),
        largest(gravity_tool_face_rad(up), tool_face, ~upright),
        largest(magnetic_tool_face_rad(field), true_field, upright),
    )


def calibrated_on_a_turntable(chips: Chips, seed: int) -> tuple[Array, Array]:
    """Both maps from 80 attitudes of 2 s each."""
    at = grid(np.arange(0.0, 181.0, 45.0), np.arange(0.0, 360.0, 90.0), np.arange(0.0, 360.0, 90.0))
    q = orientation(*at)
    up, field = settled(q, chips, AS_IT_COMES, AS_IT_COMES, seed)
    return (
        fit_affine(up, rotate(conjugate(q), GRAVITY)),
        fit_affine(field, rotate(conjugate(q), FIELD_UT)),
    )


def test_perfect_chips_meet_the_papers_figures() -> None:
    at = full_grid()
    found = worst(at, *settled(orientation(*at), Chips(), AS_IT_COMES, AS_IT_COMES, seed=1))
    assert found.inclination <= 0.1
    assert max(found.azimuth, found.gravity_tool_face, found.magnetic_tool_face) <= 1.5


@pytest.mark.parametrize("seed", [1, 2])
def test_calibrated_chips_beat_them(seed: int) -> None:
    chips = as_soldered(np.random.default_rng(seed))
    at = full_grid()
    q = orientation(*at)
    raw = worst(at, *settled(q, chips, AS_IT_COMES, AS_IT_COMES, seed=10 + seed))
    assert raw.inclination > 2.0, "nothing to calibrate"
    assert raw.azimuth > 5.0
    maps = calibrated_on_a_turntable(chips, seed=20 + seed)
    found = worst(at, *settled(q, chips, *maps, seed=30 + seed))
    assert found.inclination <= 0.1
    assert max(found.azimuth, found.gravity_tool_face, found.magnetic_tool_face) <= 0.5


def test_the_instrument_is_what_the_grid_judges() -> None:
    """Its file, its smoothing and its angles, reading by reading, against the same all at once."""
    chips = as_soldered(np.random.default_rng(4))
    acc_map, mag_map = calibrated_on_a_turntable(chips, seed=5)
    file = NodeCalibration(accelerometer=acc_map.tolist(), magnetometer=mag_map.tolist())
    q = orientation(*(np.radians([x]) for x in (10.0, 234.4, 56.1)))
    instrument = Instrument(file, declination_rad=0.1, time_constant_s=TIME_CONSTANT_S)
    rng = np.random.default_rng(6)
    for n in range(int(3 * TIME_CONSTANT_S * RATE_HZ)):
        acc, mag = readings(q, rng, chips)
        found = instrument.update(acc[0], mag[0], n * 1_000_000_000 // RATE_HZ)
    up, field = settled(q, chips, acc_map, mag_map, seed=6)
    expected = attitude(up[0], field[0], 0.1)
    assert found is not None
    assert expected is not None
    for name in ("inclination_rad", "azimuth_rad", "tool_face_rad", "magnetic_tool_face_rad"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-9)
    assert math.degrees(found.inclination_rad) == pytest.approx(10.0, abs=0.1)


def test_a_turntable_that_hardly_turns_determines_nothing() -> None:
    q = orientation(*grid(np.array([10.0, 10.1]), np.array([0.0, 0.2]), np.array([0.0])))
    up = rotate(conjugate(q), GRAVITY)
    with pytest.raises(ValueError, match="upside down"):
        fit_affine(up, up)
    with pytest.raises(ValueError, match="at least 4"):
        fit_affine(up[:3], up[:3])


def test_smoothing_begins_with_the_mean_and_ends_with_its_constant() -> None:
    smoother = Smoother(1.0)
    values = [np.array([float(n % 2), 0.0, 0.0]) for n in range(10)]
    for n, value in enumerate(values):
        found = smoother.update(value, n * 1_000_000)
    assert found == pytest.approx(np.mean(values, axis=0))
    for n in range(1000, 3000):
        smoother.update(np.zeros(3), n * 1_000_000)
    for n in range(3000, 4000):
        found = smoother.update(np.ones(3), n * 1_000_000)
    assert found[0] == pytest.approx(1.0 - math.exp(-1.0), rel=1e-3)


def test_a_reading_that_is_no_number_changes_nothing() -> None:
    smoother = Smoother(1.0)
    assert np.isnan(smoother.update(np.array([1.0, np.nan, 0.0]), 0)).all()
    first = smoother.update(np.ones(3), 1)
    assert smoother.update(np.array([np.inf, 0.0, 0.0]), 2) is first
