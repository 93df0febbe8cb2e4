"""What real sensors make of the truth: bias, scale error, noise, quantisation, saturation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.sim.suit.sensors import CHANNELS, GRAVITY_M_S2

GradeName = Literal["ideal", "calibrated", "raw"]
Counts = NDArray[np.int16]


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Standard deviations over units and axes (`noise`: over samples), in the sensor's unit."""

    bias: float
    scale: float
    """The error of each axis's own gain, a fraction."""
    cross_axis: float
    """The part of each of the other two axes that an axis picks up, a fraction."""
    noise: float


@dataclass(frozen=True, slots=True)
class Grade:
    """Errors of the three sensors of a unit: m/s², rad/s, µT."""

    accelerometer: SensorErrors
    gyro: SensorErrors
    magnetometer: SensorErrors


_MG = 1e-3 * GRAVITY_M_S2
_DEG = math.radians(1.0)
_NONE = SensorErrors(0.0, 0.0, 0.0, 0.0)

# Noise, both grades. MPU-6050 product specification rev. 3.4, with the low-pass setting for 200 Hz
# (DLPF_CFG 2: 94 and 98 Hz): 6.1 gives the gyro's total as 0.05 °/s rms there (0.005 °/s/√Hz over 100 Hz),
# 6.2 gives the accelerometer 400 µg/√Hz, which over 94 Hz is 3.9 mg. HMC5883L data sheet: noise floor
# 2 mGa, 0.2 µT. The low-pass's own delay (about 3 ms) is not modelled: nodes read the instant of SYNC.
_ACC_NOISE = 0.4 * _MG * math.sqrt(94.0)
_GYR_NOISE = 0.005 * _DEG * math.sqrt(100.0)
_MAG_NOISE = 0.2

GRADES: dict[GradeName, Grade] = {
    # nothing but saturation, quantisation and a converter's restless last bit (`LAST_BIT`)
    "ideal": Grade(_NONE, _NONE, _NONE),
    # What a calibration as in paper B leaves. Accelerometer: a session of this method on a unit of this
    # class (Tedaldi et al. 2014's recording) leaves 0.0017 m/s² on intervals held out; three times that, for
    # the temperature since. Gyro: 0.1 °/s is a bias taken at rest, drifted since. Magnetometer: an ellipsoid
    # fitted to 3 minutes at this noise is known to a few nT; 0.05 µT is ten times that, for the field around
    # a person.
    "calibrated": Grade(
        SensorErrors(bias=0.005, scale=0.001, cross_axis=0.001, noise=_ACC_NOISE),
        SensorErrors(bias=0.1 * _DEG, scale=0.002, cross_axis=0.001, noise=_GYR_NOISE),
        SensorErrors(bias=0.05, scale=0.001, cross_axis=0.001, noise=_MAG_NOISE),
    ),
    # As delivered: the same specifications' tolerances, each read as two standard deviations. MPU-6050:
    # zero-g ±50 mg (x, y), zero rate ±20 °/s, scale ±3 %, cross-axis ±2 %. HMC5883L: sensitivity ±5 %,
    # cross-axis ±0.2 % per gauss. Hard iron is the board's, not the chip's: 10 µT is an assumption.
    "raw": Grade(
        SensorErrors(bias=25.0 * _MG, scale=0.015, cross_axis=0.01, noise=_ACC_NOISE),
        SensorErrors(bias=10.0 * _DEG, scale=0.015, cross_axis=0.01, noise=_GYR_NOISE),
        SensorErrors(bias=10.0, scale=0.025, cross_axis=0.001, noise=_MAG_NOISE),
    ),
}

LAST_BIT = 0.7
"""Counts rms by which a converter's reading moves though nothing else does. Without it a sensor that stands
still would repeat one reading exactly, as only a broken one does. A bit more than what dithers away the
quantisation; at the MPU-6050's scales half of its gyro's noise and a twentieth of its accelerometer's."""
LARGEST_COUNT = np.repeat([32767.0, 32767.0, 2047.0], 3)
"""Where each channel saturates: 16-bit converters of the MPU-6050, a 12-bit one in the HMC5883L."""


class Imperfections:
    """N units of a grade. Each has errors of its own, drawn once; the noise is drawn at each sample.

    A sensor with truth s, a row, reads s (I + E) + b + n. The same seed gives the same units and noise.
    """

    def __init__(self, grade: GradeName, count: int, seed: int) -> None:
        parts = GRADES[grade]
        sensors = (parts.accelerometer, parts.gyro, parts.magnetometer)
        units, self._noise = (np.random.default_rng([seed, stream]) for stream in (0, 1))
        self._bias = units.standard_normal((count, CHANNELS)) * np.repeat([s.bias for s in sensors], 3)
        spread = np.array([np.where(np.eye(3), s.scale, s.cross_axis) for s in sensors])
        self._gain = np.eye(3) + units.standard_normal((count, 3, 3, 3)) * spread
        self._noise_sd = np.repeat([s.noise for s in sensors], 3)
        self.noisy = bool(self._noise_sd.all())
        """Whether every channel has noise."""

    def apply(self, readings: Array) -> Array:
        """What the sensors read, for what they should read, (..., N, 9) both."""
        shape = readings.shape
        distorted: Array = (readings.reshape(*shape[:-1], 3, 1, 3) @ self._gain).reshape(shape)
        distorted += self._bias
        distorted += self._noise.standard_normal(shape) * self._noise_sd
        return distorted


def quantise(readings: Array, scale: Array, random: np.random.Generator | None = None) -> tuple[Counts, Mask]:
    """Counts (..., 9) of readings, for the value of one count a channel (9,); and which saturated, (...).

    `random` moves the last bit (`LAST_BIT`); without it what stands still repeats exactly.
    """
    exact = readings / scale
    counts = np.rint(exact if random is None else exact + LAST_BIT * random.standard_normal(exact.shape))
    clipped = np.clip(counts, -LARGEST_COUNT, LARGEST_COUNT)
    return clipped.astype(np.int16), np.any(clipped != counts, axis=-1)
