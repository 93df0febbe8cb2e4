"""Units as delivered, calibrated by a session of their own as in paper B: `tandem calibrate` without files.

All units lie in one tray: 26 attitudes of 10 s each, then 3 minutes of tumbling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import IDENTITY, Array
from deploy.experiments.accuracy.papers.fixture import FIELD_UT, read_by
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.tray import Tray, TrayConfig
from master.calibrate.inertial import calibrate_inertial
from master.calibrate.magnetic import MagneticCalibration, calibrate_magnetic
from master.calibrate.recording import NodeRecording
from master.orientation.affine import Calibration

RATE_HZ = 50.0
"""Enough for turns by hand."""
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
    samples = session(units, places, chosen, seed, handled)
    affine = np.tile(np.eye(3, 4), (3, places, 1, 1))
    magnetic = []
    for unit, (acc, gyr, mag) in zip(chosen, samples.transpose(2, 1, 0, 3), strict=True):
        inertial = calibrate_inertial(NodeRecording(f"unit {unit}", RATE_HZ, acc, gyr))
        field = calibrate_magnetic(
            NodeRecording(f"unit {unit}", RATE_HZ, acc, gyr, mag), inertial.accelerometer.affine
        )
        affine[:, unit] = inertial.accelerometer.affine, inertial.gyroscope.affine, field.affine
        magnetic.append(field)
    return Calibrated(Calibration(affine, np.tile(IDENTITY, (places, 1))), tuple(magnetic))


def session(
    units: Imperfections, places: int, chosen: list[int], seed: int, handled: TrayConfig = SESSION
) -> Array:
    """Samples (T, 3, len(chosen), 3) of a session."""
    tray = Tray(handled, places, seed)
    times_s = np.arange(0.0, tray.period_s, 1.0 / RATE_HZ)
    samples = [
        # a part at a time: all units' readings at once would take hundreds of MB
        read_by(units, np.array([tray.readings(t, FIELD_UT) for t in some.tolist()]))[:, :, chosen]
        for some in np.array_split(times_s, 20)
    ]
    return np.concatenate(samples)
