"""Magnetometer to accelerometer: the small rotation between the axes that their calibrations chose.

Each calibration knows its sensor's readings by their length alone, and so chooses axes of its own: the
accelerometer's from its triangular matrix, the magnetometer's from its symmetric one. As delivered they lie
some half a degree apart, which at a dip of 60° turns the heading by as much as a degree, by another amount in
each attitude. What tells is that the field's dip, the angle between both vectors, is the same in every
attitude (Kok and Schön, IEEE Sensors Journal 16(14), 2016, use the same invariant).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, cross, from_rotation_vector, multiply, normalise, rotate, to_matrix
from master.calibrate.recording import RecordingError

_FEWEST_ATTITUDES = 8
_STEPS = 10
_LARGEST_RAD = np.radians(10.0)
"""Axes further apart are no imperfection: the two sensors are then mounted differently."""
_WORST_CONDITION = 1e3


class UndeterminedError(RecordingError):
    """The attitudes do not show how the magnetometer is turned; nothing contradicts its axes either."""


@dataclass(frozen=True, slots=True)
class MagnetometerRotation:
    """What was found, and how good it is."""

    q_acc_from_mag: Array
    """(4,): turns calibrated magnetometer readings into the calibrated accelerometer's axes."""
    before_rad: float
    """RMS over the attitudes of the dip's error with the axes as they were; and now."""
    after_rad: float
    sigma_rad: float
    """One standard deviation of the rotation, about its worst axis."""

    @property
    def angle_rad(self) -> float:
        """How far apart the axes were."""
        return 2.0 * float(np.arccos(min(1.0, abs(float(self.q_acc_from_mag[0])))))

    def apply(self, affine: Array) -> Array:
        """A magnetometer's map (3, 4) with its outcome in the accelerometer's axes."""
        return rotate(self.q_acc_from_mag, affine.T).T

    def widen(self, sigma: Array, affine: Array) -> Array:
        """1σ (3, 4) of what `apply` gives, of a map's 1σ (3, 4): the rotation's own is added."""
        turned, rotation = self.apply(affine), to_matrix(self.q_acc_from_mag)
        # a turn by δ moves a column by δ × column: what it has across each axis
        across = np.maximum(np.sum(turned**2, axis=0) - turned**2, 0.0)
        out: Array = np.sqrt(rotation**2 @ sigma**2 + self.sigma_rad**2 * across)
        return out


def align_magnetometer(acc: Array, mag: Array) -> MagnetometerRotation:
    """Calibrated readings (K, 3) of both sensors, at rest in K attitudes. Only directions count.

    Gauss-Newton over rotation r and c = -sin(dip): a · exp(r) m = c in every attitude.
    Raises UndeterminedError where the attitudes do not determine it, and RecordingError where the sensors
    contradict each other.
    """
    again = "rest the node in twenty attitudes, every side up and turned about the vertical too"
    if len(acc) < _FEWEST_ATTITUDES:
        raise UndeterminedError(f"{len(acc)} attitudes do not show how the magnetometer is turned; {again}")
    up, field = normalise(acc), normalise(mag)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    before = _dip_errors(up, field)
    for _ in range(_STEPS):
        turned = rotate(q, field)
        product = np.sum(up * turned, axis=1)
        jacobian = np.column_stack([cross(turned, up), -np.ones(len(up))])
        if not np.linalg.cond(jacobian) < _WORST_CONDITION:
            raise UndeterminedError(f"the attitudes do not show how the magnetometer is turned; {again}")
        step = np.linalg.lstsq(jacobian, np.mean(product) - product, rcond=None)[0]
        q = normalise(multiply(from_rotation_vector(step[:3]), q))
    after = _dip_errors(up, rotate(q, field))
    product = np.sum(up * rotate(q, field), axis=1)
    variance = float(np.sum((product - product.mean()) ** 2)) / (len(up) - 4)
    covariance = variance * np.linalg.inv(jacobian.T @ jacobian)[:3, :3]
    found = MagnetometerRotation(
        q,
        float(np.sqrt(np.mean(before**2))),
        float(np.sqrt(np.mean(after**2))),
        float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])),
    )
    if found.angle_rad > _LARGEST_RAD:
        raise RecordingError("accelerometer and magnetometer sit more than 10° apart; is one of them turned?")
    return found


def _dip_errors(up: Array, field: Array) -> Array:
    dip = np.arcsin(np.clip(np.sum(up * field, axis=1), -1.0, 1.0))
    out: Array = dip - dip.mean()
    return out
