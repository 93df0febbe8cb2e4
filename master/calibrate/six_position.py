"""Six attitudes and three turns: accelerometer and gyroscope of one node in the axes of its housing.

Ferraris, Grimaldi and Parvis, "Procedure for effortless in-field calibration of three-axis rate gyros and
accelerometers" (Sensors and Materials 7(5), 1995). The node lies on each of its six faces, in any order; then
it is turned by a known angle about each axis, either way. The bias of the gyroscope is what it reads at rest;
its gain takes the three turns' integrals to that angle about the axes. The accelerometer's twelve unknowns
come from the norm of gravity, which holds however a face lies, and from gravity's direction, as well as a
hand can lay it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from master.calibrate.carried import AXES
from master.calibrate.evidence import CrossCheck, at_most
from master.calibrate.recording import RecordingError
from master.calibrate.still import Intervals, interval_means
from master.calibrate.uncertainty import covariance

FACES: Array = np.concatenate([np.eye(3), -np.eye(3)])
_FACE_COS = float(np.cos(np.radians(25.0)))
_NORM_SIGMA_M_S2 = 0.004
"""Least 1σ of the norm at rest: what a sensor's own non-linearity leaves."""
_LEAST_TILT_RAD, _MOST_TILT_RAD = float(np.radians(0.2)), float(np.radians(5.0))
_TURN_SIGMA = 0.003
"""Least 1σ of a turn's angle over itself, made by hand against a stop: 1° of 360°."""
_AXIS_COS = float(np.cos(np.radians(20.0)))
_ANGLE_SHARE = 0.25
"""So far may an uncalibrated gyroscope's turn be off its angle."""
_HOW = "lay the node on each of its six faces, some seconds each, and turn it about each of its axes"


@dataclass(frozen=True, slots=True)
class SixFaces:
    """The accelerometer's map, by the faces."""

    affine: Array
    """(3, 4), m/s²."""
    sigma: Array
    """(3, 4)."""
    before_m_s2: Array
    """(K,) ‖a‖ - g of the rests as they came."""
    after_m_s2: Array
    """(K,) the same, calibrated."""
    tilt_rad: float
    """RMS of how far gravity lies off the faces' normals."""


@dataclass(frozen=True, slots=True)
class ThreeTurns:
    """The gyroscope's map, by the turns."""

    affine: Array
    """(3, 4), rad/s."""
    sigma: Array
    """(3, 4)."""
    before_rad: Array
    """(M,) how far each turn's angle was off, with the bias taken off alone."""
    after_rad: Array
    """(M,) the same, calibrated."""


def faces(readings: Array, counts: bool) -> tuple[Array, Mask]:
    """The face (K, 3) that gravity was read along in each rest, and in which (K,) it was one at all.

    Raises RecordingError where one of the six is missing.
    """
    middle = 0.5 * (readings.max(axis=0) + readings.min(axis=0)) if counts else np.zeros(3)
    unit = readings - middle
    unit = unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-12)
    nearest = np.argmax(unit @ FACES.T, axis=1)
    on_face: Mask = np.max(unit @ FACES.T, axis=1) > _FACE_COS
    missing = [f for f in range(6) if not np.any(on_face & (nearest == f))]
    if missing:
        names = ", ".join(f"{'+' if f < 3 else '-'}{AXES[f % 3]}" for f in missing)
        raise RecordingError(f"no rest with gravity along {names} was found; {_HOW}")
    return FACES[nearest], on_face


def fit_faces(readings: Array, gravity_m_s2: float, *, counts: bool = False) -> SixFaces:
    """Fit to the mean readings (K ≥ 6, 3) at rest. Raises RecordingError."""
    from scipy.optimize import least_squares

    which, on_face = faces(readings, counts)
    ends = np.array(
        [[readings[on_face & (which[:, i] == s)][:, i].mean() for s in (1, -1)] for i in range(3)]
    )
    gain, middle = 2.0 * gravity_m_s2 / (ends[:, 0] - ends[:, 1]), ends.mean(axis=1)
    m = (readings - middle) * gain
    across = np.eye(3)[None] - which[:, :, None] * which[:, None, :]
    tilt = _LEAST_TILT_RAD

    def left(x: Array) -> Array:
        force = m @ x[:9].reshape(3, 3).T + x[9:]
        norm = (np.linalg.norm(force, axis=1) - gravity_m_s2) / _NORM_SIGMA_M_S2
        off = np.einsum("kij,kj->ki", across, force) / (gravity_m_s2 * tilt)
        return np.concatenate([norm, off[on_face].ravel()])

    x = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    for _ in range(4):
        solved = least_squares(left, x, method="lm", x_scale=np.r_[np.ones(9), np.full(3, gravity_m_s2)])
        x = solved.x
        off = left(x)[len(m) :] * tilt
        # two figures a rest, of which six say how the sensor's axes lie
        freedom = max(2 * int(on_face.sum()) - 6, 1)
        tilt = max(float(np.sqrt(off @ off / freedom)), _LEAST_TILT_RAD)
    slope = np.asarray(least_squares(left, x, method="lm", max_nfev=200).jac, dtype=np.float64)
    used = slope[np.any(slope != 0.0, axis=1)]
    freedom = max(2 * int(on_face.sum()) - 6, 1)
    cov = covariance(used, np.zeros(len(used)), freedom, least_variance=_student(freedom) ** 2)
    matrix, offset = x[:9].reshape(3, 3) * gain, x[9:] - x[:9].reshape(3, 3) @ (gain * middle)
    rows = np.zeros((12, 12))
    for i in range(3):
        for j in range(3):
            rows[4 * i + j, 3 * i + j] = gain[j]
            rows[4 * i + 3, 3 * i + j] = -gain[j] * middle[j]
        rows[4 * i + 3, 9 + i] = 1.0
    sigma = np.sqrt(np.diag(rows @ cov @ rows.T)).reshape(3, 4)
    plain = readings if not counts else m
    return SixFaces(
        np.column_stack([matrix, offset]),
        sigma,
        np.linalg.norm(plain, axis=1) - gravity_m_s2,
        np.linalg.norm(readings @ matrix.T + offset, axis=1) - gravity_m_s2,
        tilt,
    )


def _student(freedom: int) -> float:
    from scipy.stats import t

    return float(t.ppf(0.975, freedom)) / 1.96


def fit_turns(rates: Array, still: Intervals, gravity: Array, rate_hz: float, angle_rad: float) -> ThreeTurns:
    """Fit to rates (T, 3), for rests (K, 2) with calibrated gravity (K, 3) in them. Raises RecordingError."""
    means = interval_means(rates, still)
    bias = means.mean(axis=0)
    noise = np.nanstd(np.concatenate([rates[a:b] for a, b in still]), axis=0)
    bias_sigma = np.maximum(means.std(axis=0, ddof=1), noise) / np.sqrt(len(still))
    found = _turns(rates - bias, still, gravity, rate_hz)
    turned, axis = _three(found, angle_rad)
    wanted = angle_rad * axis
    gain = np.linalg.lstsq(turned, wanted, rcond=None)[0].T
    # the angle's own error, how far a turn swings about other axes, and the bias over its time
    seconds = np.array([one[1] for one in found])
    errors = (turned @ gain.T - wanted)[np.any(axis != 0.0, axis=1)]
    spread = float(np.sqrt(np.mean(errors**2))) if len(errors) > 3 else 0.0
    drift = float(np.max(bias_sigma)) * float(np.max(seconds)) / angle_rad
    each = np.hypot(max(spread / angle_rad, _TURN_SIGMA), drift)
    of_gain = each * np.abs(np.cbrt(np.linalg.det(gain))) * np.ones((3, 3))
    of_offset = np.sqrt(gain**2 @ bias_sigma**2 + of_gain**2 @ bias**2)
    plain = np.linalg.norm(turned, axis=1) - angle_rad
    return ThreeTurns(
        np.column_stack([gain, -gain @ bias]),
        np.column_stack([of_gain, of_offset]),
        plain,
        np.linalg.norm(turned @ gain.T, axis=1) - angle_rad,
    )


def turn_scale(rates: Array, still: Intervals, gravity: Array, rate_hz: float, angle_rad: float) -> float:
    """rad/s of one count, where the largest turns about an axis are those by the angle."""
    bias = interval_means(rates, still).mean(axis=0)
    sizes = [
        float(np.linalg.norm(turned))
        for turned, _ in _turns(rates - bias, still, gravity, rate_hz)
        if np.max(np.abs(turned)) > _AXIS_COS * np.linalg.norm(turned)
    ]
    if not sizes:
        raise RecordingError(f"no turn about an axis was found; {_HOW}")
    return angle_rad / float(np.median([size for size in sizes if size > 0.8 * max(sizes)]))


def _turns(rates: Array, still: Intervals, gravity: Array, rate_hz: float) -> list[tuple[Array, float]]:
    """Integral (3,) of the rates and duration, s, of what leads from rest to rest and brings gravity back."""
    unit = gravity / np.linalg.norm(gravity, axis=1, keepdims=True)
    out = []
    for n in range(len(still) - 1):
        # rolled over its edges, a turn may rest on each face
        for last in range(n + 1, min(n + 5, len(still))):
            a, b = int(still[n, 1]) - 1, int(still[last, 0])
            moved = rates[a : b + 1]
            if unit[n] @ unit[last] < _AXIS_COS or not np.isfinite(moved).all():
                continue
            whole = 0.5 * (moved[1:] + moved[:-1])
            out.append((np.asarray(whole.sum(axis=0) / rate_hz), (b - a) / rate_hz))
            break
    return out


def _three(found: list[tuple[Array, float]], angle_rad: float) -> tuple[Array, Array]:
    """The turns (M, 3) that are about an axis and by the angle, and the signed axis of each (M, 3)."""
    turned, axes = [], []
    for integral, _ in found:
        size = float(np.linalg.norm(integral))
        place = int(np.argmax(np.abs(integral)))
        by_axis = abs(float(integral[place])) > _AXIS_COS * size
        if by_axis and abs(size / angle_rad - 1.0) < _ANGLE_SHARE:
            turned.append(integral)
            axes.append(np.sign(integral[place]) * np.eye(3)[place])
    missing = [AXES[i] for i in range(3) if not any(a[i] for a in axes)]
    if missing and found:
        largest = max(float(np.linalg.norm(t)) for t, _ in found) / angle_rad
        if abs(largest * np.pi / 180.0 - 1.0) < _ANGLE_SHARE:
            raise RecordingError("the gyroscope's readings are in °/s, not rad/s; multiply them by π/180")
    if missing:
        best = ", ".join(f"{np.degrees(np.linalg.norm(t)):.0f}°" for t, _ in found) or "none"
        raise RecordingError(
            f"no turn by {np.degrees(angle_rad):.0f}° about {', '.join(missing)} was found (from rest to "
            f"rest, gravity back where it was: {best}); {_HOW} by a whole "
            "turn from rest to rest, or say --turn-deg"
        )
    return np.array(turned), np.array(axes)


def check_tilt(tilt_rad: float) -> CrossCheck:
    """How square the node lay on its faces."""
    return at_most(
        "gravity against the normals of the six faces",
        float(np.degrees(tilt_rad)),
        float(np.degrees(_MOST_TILT_RAD)),
        "°",
        advice=f"gravity lies {np.degrees(tilt_rad):.0f}° off the faces: level the table, lay the node flat; "
        "without flat faces use the method of many attitudes",
    )
