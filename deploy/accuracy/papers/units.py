"""Units as delivered, calibrated by a session of their own as in paper B: `tandem calibrate` without files.

All units lie in one tray: 26 attitudes of 10 s each, then 3 minutes of tumbling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import IDENTITY, Array
from deploy.accuracy.papers.fixture import FIELD_UT, read_by
from master.calibrate.affine import Calibration
from master.calibrate.alignment import align_magnetometer
from master.calibrate.inertial import calibrate_inertial
from master.calibrate.magnetic import MagneticCalibration, calibrate_magnetic
from master.calibrate.recording import NodeRecording
from master.calibrate.still import interval_means
from master.suit.simulated.imperfections import Imperfections
from master.suit.simulated.tray import Tray, TrayConfig

RATE_HZ = 50.0
"""Enough for turns by hand."""
SHORT_SESSION = TrayConfig(attitudes=20, still_s=2.5, tumble_s=60.0)
"""For whoever cannot wait."""
SESSION = TrayConfig(attitudes=26, still_s=10.0, tumble_s=180.0)


@dataclass(frozen=True, slots=True)
class Calibrated:
    """What a session made of N units."""

    calibration: Calibration
    magnetic: tuple[MagneticCalibration, ...]


def calibrate(
    units: Imperfections, places: int, chosen: list[int], seed: int, handled: TrayConfig = SESSION
) -> Calibrated:
    """Calibrate the `chosen` of the `places` units in the tray; the others keep their raw readings.

    Raises RecordingError where the session does not determine a unit.
    """
    samples, tumbling = session(units, places, chosen, seed, handled)
    affine = np.tile(np.eye(3, 4), (3, places, 1, 1))
    magnetic = []
    for unit, (acc, gyr, mag) in zip(chosen, samples.transpose(2, 1, 0, 3), strict=True):
        inertial = calibrate_inertial(NodeRecording(f"unit {unit}", RATE_HZ, acc, gyr))
        whole = (acc[tumbling], gyr[tumbling], mag[tumbling])
        field = calibrate_magnetic(NodeRecording(f"unit {unit}", RATE_HZ, *whole))
        force, strength = (
            interval_means(apply_map(map_, readings), inertial.still)
            for map_, readings in ((inertial.accelerometer.affine, acc), (field.fit.affine, mag))
        )
        affine[:, unit] = (
            inertial.accelerometer.affine,
            inertial.gyroscope.affine,
            align_magnetometer(force, strength).apply(field.fit.affine),
        )
        magnetic.append(field)
    return Calibrated(Calibration(affine, np.tile(IDENTITY, (places, 1))), tuple(magnetic))


def apply_map(affine: Array, readings: Array) -> Array:
    """Calibrated readings (T, 3) for a map (3, 4)."""
    out: Array = readings @ affine[:, :3].T + affine[:, 3]
    return out


def session(
    units: Imperfections, places: int, chosen: list[int], seed: int, handled: TrayConfig = SESSION
) -> tuple[Array, slice]:
    """Samples (T, 3, len(chosen), 3) of a session, and the rows in which the tray is tumbled about."""
    tray = Tray(handled, places, seed)
    times_s = np.arange(0.0, tray.period_s, 1.0 / RATE_HZ)
    samples = [
        # a part at a time: all units' readings at once would take hundreds of MB
        read_by(units, np.array([tray.readings(t, FIELD_UT) for t in some.tolist()]))[:, :, chosen]
        for some in np.array_split(times_s, 20)
    ]
    tumbling = slice(round((tray.period_s - handled.tumble_s) * RATE_HZ), None)
    return np.concatenate(samples), tumbling
