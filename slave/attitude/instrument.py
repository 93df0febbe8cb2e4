"""From raw readings of the two sensors to the angles: calibrate ▸ smooth ▸ solve."""

from __future__ import annotations

import numpy as np

from common.config.sensor_calibration import NodeCalibration
from common.quaternion import Array
from slave.attitude.attitude import Attitude, attitude
from slave.attitude.smooth import Smoother

QUICK_S = 0.1
"""Time constant of what a limit is judged by: noise of 0.06°, and no fall is seen late."""


class Instrument:
    """One accelerometer and one magnetometer along the same axes, as `calibration` maps their readings."""

    def __init__(
        self,
        calibration: NodeCalibration | None = None,
        declination_rad: float = 0.0,
        time_constant_s: float = 3.0,
    ) -> None:
        sound = calibration or NodeCalibration()
        self._acc = np.array(sound.accelerometer)
        self._mag = np.array(sound.magnetometer)
        self._declination_rad = declination_rad
        self._up = Smoother(time_constant_s)
        self._field = Smoother(time_constant_s)
        self._quick_up = Smoother(min(QUICK_S, time_constant_s))
        self.quick_up: Array = np.full(3, np.nan)
        """(3,) up, smoothed just enough to judge a tilt by; NaN before any reading."""

    def update(self, acc_m_s2: Array, mag_ut: Array, now_ns: int) -> Attitude | None:
        """The attitude after raw readings (3,) of specific force and field; None before any is sound."""
        acc = affine(self._acc, acc_m_s2)
        self.quick_up = self._quick_up.update(acc, now_ns)
        up = self._up.update(acc, now_ns)
        field = self._field.update(affine(self._mag, mag_ut), now_ns)
        return attitude(up, field, self._declination_rad)


def affine(map_: Array, reading: Array) -> Array:
    """Calibrated readings (..., 3) of raw ones by a map (3, 4)."""
    out: Array = reading @ map_[:, :3].T + map_[:, 3]
    return out
