from __future__ import annotations

import math

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.suit.imperfections import GRADES, GradeName, Imperfections, quantise
from deploy.sim.suit.sensors import GRAVITY_M_S2
from master.suit.protocol import SuitProtocol

SENSORS = (slice(0, 3), slice(3, 6), slice(6, 9))
NAMES = ("accelerometer", "gyro", "magnetometer")
UNITS, SAMPLES = 400, 300


def still_readings(count: int) -> Array:
    return np.tile([0.0, 0.0, GRAVITY_M_S2, 0.0, 0.0, 0.0, 0.0, 25.0, -43.3], (count, 1))


@pytest.mark.parametrize("grade", ["calibrated", "raw"])
def test_noise_and_bias_have_the_spread_of_the_table(grade: GradeName) -> None:
    units = Imperfections(grade, UNITS, seed=5)
    # zero truth, so that gains play no part
    samples = np.array([units.apply(np.zeros((UNITS, 9))) for _ in range(SAMPLES)])
    for sensor, name in zip(SENSORS, NAMES, strict=True):
        expected = getattr(GRADES[grade], name)
        noise = samples[:, :, sensor].std(axis=0, ddof=1).mean()
        assert noise == pytest.approx(expected.noise, rel=0.02)
        # what is left of the noise in a mean of so many samples stands beside the bias
        spread = math.hypot(expected.bias, expected.noise / math.sqrt(SAMPLES))
        assert samples[:, :, sensor].mean(axis=0).std() == pytest.approx(spread, rel=0.1)


@pytest.mark.parametrize("grade", ["calibrated", "raw"])
@pytest.mark.parametrize("place", range(3))
def test_scale_and_cross_axis_have_the_spread_of_the_table(grade: GradeName, place: int) -> None:
    truth = np.zeros((UNITS, 9))
    truth[:, [0, 3, 6]] = 1e7  # along x of each sensor, large against bias and noise
    errors = (Imperfections(grade, UNITS, seed=6).apply(truth) - truth)[:, SENSORS[place]] / 1e7
    expected = getattr(GRADES[grade], NAMES[place])
    assert errors[:, 0].std() == pytest.approx(expected.scale, rel=0.15)
    assert errors[:, 1:].std() == pytest.approx(expected.cross_axis, rel=0.15)


def test_noise_is_white() -> None:
    units = Imperfections("calibrated", 1, seed=7)
    x = np.array([units.apply(np.zeros((1, 9)))[0, 0] for _ in range(20_000)])
    x -= x.mean()
    assert abs(np.mean(x[1:] * x[:-1])) < 4.0 / np.sqrt(len(x)) * x.var()


def test_an_ideal_unit_only_quantises(protocol: SuitProtocol) -> None:
    readings = np.random.default_rng(8).uniform(-30.0, 30.0, (36, 9))
    np.testing.assert_array_equal(Imperfections("ideal", 36, seed=1).apply(readings), readings)
    scale = protocol.fd.scale
    counts, saturated = quantise(readings, scale)
    assert not saturated.any()
    assert (np.abs(counts * scale - readings) <= 0.5 * scale + 1e-12).all()


def test_the_residual_after_calibration_is_far_smaller_than_before() -> None:
    truth = still_readings(UNITS)
    rms = {
        grade: np.sqrt(np.mean((Imperfections(grade, UNITS, 9).apply(truth) - truth) ** 2, axis=0))
        for grade in ("calibrated", "raw")
    }
    assert (rms["raw"] > 3.0 * rms["calibrated"]).all()


def test_the_seed_decides_units_and_noise() -> None:
    truth = still_readings(36)
    one, same, other = (Imperfections("calibrated", 36, seed) for seed in (1, 1, 2))
    for _ in range(3):
        reading = one.apply(truth)
        np.testing.assert_array_equal(same.apply(truth), reading)
        assert (other.apply(truth) != reading).all()


@pytest.mark.parametrize(("channel", "largest"), [(0, 32767), (5, 32767), (7, 2047)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_readings_saturate_just_beyond_the_converters_range(
    protocol: SuitProtocol, channel: int, largest: int, sign: int
) -> None:
    scale = protocol.fd.scale
    readings = np.zeros((2, 9))
    readings[0, channel] = sign * (largest + 0.49) * scale[channel]
    readings[1, channel] = sign * (largest + 0.51) * scale[channel]
    counts, saturated = quantise(readings, scale)
    assert saturated.tolist() == [False, True]
    assert counts[:, channel].tolist() == [sign * largest] * 2


def test_noise_is_above_the_quantum_so_that_it_dithers(protocol: SuitProtocol, skeleton: Skeleton) -> None:
    grade = GRADES["calibrated"]
    assert grade.accelerometer.noise > protocol.acc_scale
    assert grade.magnetometer.noise > protocol.mag_scale
    assert grade.gyro.noise > 0.5 * protocol.gyr_scale
