"""An ADXL330 and an HMC5843 as their data sheets have them, and an instrument made of the two.

ADXL330 at 3 V: 300 mV/g, 280 µg/√Hz across and 350 µg/√Hz along z, here with 50 Hz of bandwidth (× 1.6 for a
single pole), read by 12 bits over 3.3 V. HMC5843: 1300 counts a gauss at its own gain; 2 mGa of noise, as its
maker states for the successor of the same bridges.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from common.quaternion import Array, conjugate, rotate

GRAVITY_M_S2 = 9.80665
_UT_PER_GAUSS = 100.0
_NOISE_BAND_HZ = 50.0 * 1.6
ACC_NOISE_M_S2: Array = np.array([280e-6, 280e-6, 350e-6]) * np.sqrt(_NOISE_BAND_HZ) * GRAVITY_M_S2
"""(3,), 1σ of one reading."""
ACC_STEP_M_S2 = 3.3 / 4096 / 0.3 * GRAVITY_M_S2
ACC_RANGE_M_S2 = 3.0 * GRAVITY_M_S2
MAG_NOISE_UT = 2e-3 * _UT_PER_GAUSS
MAG_STEP_UT = _UT_PER_GAUSS / 1300.0
MAG_RANGE_UT = 2048 * MAG_STEP_UT
FIELD_UT: Array = np.array([0.0, 34.5, -36.0])
"""(3,) magnetic east, north, up, about as at the paper's place."""


def _identity() -> Array:
    return np.eye(3)


@dataclass(frozen=True, slots=True)
class ChipErrors:
    """What one sensor's readings are of the truth: matrix · truth + offset, then noise and rounding."""

    matrix: Array = field(default_factory=_identity)
    """(3, 3): scale, axes that are not square, and how the chip sits in the case."""
    offset: Array = field(default_factory=lambda: np.zeros(3))
    """(3,), in the reading's unit; for the magnetometer the hard iron."""


@dataclass(frozen=True, slots=True)
class Chips:
    """The two sensors of one instrument."""

    acc: ChipErrors = field(default_factory=ChipErrors)
    mag: ChipErrors = field(default_factory=ChipErrors)


def readings(
    q_world_from_instrument: Array,
    rng: np.random.Generator,
    chips: Chips | None = None,
    field_ut: Array = FIELD_UT,
) -> tuple[Array, Array]:
    """Raw specific force, m/s², and field, µT, each (..., 3), of an instrument at rest at (..., 4).

    World is magnetic: its north is where `field_ut` (3,) points.
    """
    made = chips or Chips()
    back = conjugate(q_world_from_instrument)
    up = rotate(back, np.array([0.0, 0.0, GRAVITY_M_S2]))
    acc = up @ made.acc.matrix.T + made.acc.offset
    mag = rotate(back, field_ut) @ made.mag.matrix.T + made.mag.offset
    return (
        _digitised(acc + rng.normal(size=acc.shape) * ACC_NOISE_M_S2, ACC_STEP_M_S2, ACC_RANGE_M_S2),
        _digitised(mag + rng.normal(size=mag.shape) * MAG_NOISE_UT, MAG_STEP_UT, MAG_RANGE_UT),
    )


def _digitised(value: Array, step: float, most: float) -> Array:
    out: Array = np.clip(np.round(value / step) * step, -most, most)
    return out
