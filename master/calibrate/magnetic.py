"""The magnetometer of one node from a recording of free rotation (paper B, 2.2.3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date

import numpy as np
from numpy.typing import NDArray

from common.config.sensor_calibration import Made
from common.quaternion import Array
from master.calibrate.codes import clean
from master.calibrate.ellipsoid import (
    Ellipsoid,
    NoEllipsoidError,
    affine_sigma,
    coverage,
    fit_ellipsoid,
    off_ut,
    spread_ut,
)
from master.calibrate.evidence import CrossCheck, refuse_contradictions, unjudged
from master.calibrate.magnetometer_axes import Hemisphere, check_axes
from master.calibrate.magnetometer_rotation import MagnetometerRotation, UndeterminedError, align_magnetometer
from master.calibrate.node_file import Part
from master.calibrate.recording import NodeRecording, RecordingError
from master.calibrate.soundness import check_clipped, check_samples
from master.calibrate.still import interval_means, motion_level, still_intervals, stillest_level
from master.calibrate.uncertainty import folds

LEAST_COVERAGE = 0.5
GOOD_COVERAGE = 0.8
MOST_CENTRE_ERROR = 0.1
"""Of the hard iron as stated, 95 %, over the field."""
_MOST_OUTLIERS = 0.05
"""So many readings may lie off the ellipsoid: a door, a passing trolley. More, and the field was another."""
MOST_SPREAD = 0.1
"""Of the calibrated strength over itself; beyond it the field is not one field."""
_FIELD_UT = (10.0, 200.0)
"""The earth's field is 22 to 67 µT; a room's iron makes no more of it than this. Gauss and mG lie outside."""
_FEWEST_SAMPLES = 100
_BLOCK_S = 2.0
"""Neighbouring samples are alike: what is held out are blocks of this length."""
_LIMIT_S = 0.5
"""No turning node reads the very same so long."""
_REST_S = 1.0
_MOST_AT_REST_RAD_S = 0.05
"""Slower than anybody turns a node about: a recording without rests has none."""
_TURN = "turn the node slowly through every attitude, as if to paint the inside of a ball"


@dataclass(frozen=True, slots=True)
class MagneticCalibration:
    """What was found, and how good it is."""

    name: str
    fit: Ellipsoid
    sigma: Array
    """1σ of the map, (3, 4)."""
    coverage: float
    """Share of the sphere seen, 0 to 1."""
    readings_ut: Array
    """(K, 3), those that were used."""
    hold_out_ut: Array
    """(K,), calibrated strength minus the field, by fits that did not see the reading."""
    rotation: MagnetometerRotation | None = None
    """Into the accelerometer's axes; None where they are not known."""
    notes: tuple[str, ...] = ()
    evidence: tuple[CrossCheck, ...] = ()
    """What was compared before this was believed."""
    axes: Array = field(default_factory=lambda: np.eye(3))
    """(3, 3), the signed permutation that took the readings as they came to the node's axes, before the
    fit."""

    @property
    def affine(self) -> Array:
        """(3, 4): calibrated µT, in the accelerometer's axes where they are known, from readings."""
        plain = self.fit.affine if self.rotation is None else self.rotation.apply(self.fit.affine)
        return np.column_stack([plain[:, :3] @ self.axes, plain[:, 3]])

    @property
    def spread_before_ut(self) -> float:
        """Standard deviation of the strength as it came."""
        return float(np.std(np.linalg.norm(self.readings_ut, axis=1)))

    @property
    def spread_after_ut(self) -> float:
        """Standard deviation of the calibrated strength."""
        return float(np.std(self.fit.norms(self.readings_ut)))

    @property
    def hold_out_spread_ut(self) -> float:
        """Root mean square of `hold_out_ut`."""
        return float(np.sqrt(np.mean(self.hold_out_ut**2)))

    def parts(self, day: date, recording: str) -> dict[Part, tuple[Array, Made]]:
        """As `write_calibration` takes them."""
        made = Made(
            date=day,
            recording=recording,
            unit="µT",
            residual_before=self.spread_before_ut,
            residual_after=self.spread_after_ut,
            hold_out=self.hold_out_spread_ut,
            sigma=self.sigma.tolist(),
        )
        return {"magnetometer": (self.affine, made)}


@dataclass(frozen=True, slots=True)
class MagneticOptions:
    """What a person may choose."""

    hemisphere: Hemisphere = "north"
    """Where it was recorded: the field dips below the horizon in the north, and rises in the south."""
    axes: Array | None = None
    """(3, 3): a signed permutation, accepted by a person, that takes the readings to the node's axes."""
    overflow_ut: tuple[float, ...] = ()
    """Values that the converter or its driver gives for "out of range", as they stand in the recording."""


def calibrate_magnetic(
    recording: NodeRecording,
    accelerometer: Array | None = None,
    options: MagneticOptions = MagneticOptions(),
) -> MagneticCalibration:
    """Find the magnetometer's map.

    Raises RecordingError when the recording does not determine it, or contradicts itself.

    With the accelerometer's map (3, 4), and rests in the recording, the magnetometer's axes are turned into
    the accelerometer's; a note says where that was not possible.
    """
    if recording.mag_ut is None:
        raise RecordingError("there are no magnetometer readings; record a node that has one")
    axes = np.eye(3) if options.axes is None else options.axes
    whole = clean(recording.mag_ut, options.overflow_ut)
    mag = whole.readings @ axes.T
    check_samples("magnetometer", mag, whole.missing)
    everywhere = np.ones(len(mag), dtype=np.bool_)
    check_clipped(
        "magnetometer",
        mag,
        everywhere,
        max(3, round(_LIMIT_S * recording.rate_hz)),
        "set a larger range, or take it away from the magnet",
    )
    known = np.all(np.isfinite(mag), axis=1)
    blocks = np.flatnonzero(known) // max(1, round(_BLOCK_S * recording.rate_hz))
    fit, sigma, hold_out = _fitted(mag[known], blocks)
    seen = coverage(fit, mag[known])
    calibrated = mag @ fit.affine[:, :3].T + fit.affine[:, 3]
    evidence = refuse_contradictions(check_axes(recording, calibrated, options.hemisphere))
    notes = [*recording.notes, *whole.notes]
    if seen < GOOD_COVERAGE:
        notes.append(
            f"{100 * seen:.0f} % of the sphere seen; more makes it surer: the hard iron is known to "
            f"±{1.96 * float(sigma[:, 3].max()):.2g} µT (95 %)"
        )
    rotation, words = _align(recording, mag, fit, accelerometer)
    remarks = (*words, *unjudged(evidence))
    if rotation is not None:
        sigma = rotation.widen(sigma, fit.affine)
    return MagneticCalibration(
        name=recording.name,
        fit=fit,
        sigma=np.column_stack([sigma[:, :3] @ np.abs(axes), sigma[:, 3]]),
        coverage=seen,
        readings_ut=mag[known],
        hold_out_ut=hold_out,
        rotation=rotation,
        notes=(*notes, *(("; ".join(remarks),) if remarks else ())),
        evidence=evidence,
        axes=axes,
    )


def _fitted(readings: Array, blocks: NDArray[np.intp]) -> tuple[Ellipsoid, Array, Array]:
    """The ellipsoid of readings (K, 3), its map's 1σ (3, 4), what it holds out (K,)."""
    if len(readings) < _FEWEST_SAMPLES:
        raise RecordingError(f"{len(readings)} readings are too few; {_TURN}, for 3 minutes")
    try:
        fit = fit_ellipsoid(readings)
        _check_field(fit, readings)
        sigma = affine_sigma(fit, readings) * _widened(fit, readings, blocks)
        _check_coverage(fit, readings, sigma)
        hold_out = _held_out(fit, readings, blocks)
    except NoEllipsoidError as error:
        raise RecordingError(f"the sphere is covered too thinly: {error}; {_TURN}") from None
    return fit, sigma, hold_out


def _check_field(fit: Ellipsoid, readings: Array) -> None:
    """Refuse a field that is not one field, or in another unit; where too little was seen, say that first."""
    if coverage(fit, readings) < LEAST_COVERAGE:
        return
    off = np.abs(off_ut(fit, readings)) / fit.field_ut
    spread = max(spread_ut(fit, readings) / fit.field_ut, float(np.quantile(off, 1.0 - _MOST_OUTLIERS)) / 2.0)
    if spread > MOST_SPREAD:
        raise RecordingError(
            f"the calibrated field varies by {100 * spread:.0f} %: it was disturbed; go away from iron, "
            "motors and magnets, and record again"
        )
    if not _FIELD_UT[0] < fit.field_ut < _FIELD_UT[1]:
        raise RecordingError(
            f"the field is {fit.field_ut:.3g} µT strong, and the earth's is 22 to 67 µT; "
            "are the readings in µT? 1 gauss is 100 µT"
        )


def _widened(fit: Ellipsoid, readings: Array, blocks: NDArray[np.intp]) -> float:
    """By how much the fit is less sure than it says, as readings next to each other err alike: at least 1.

    The root of the variance of the blocks' summed errors over what independent readings would give.
    """
    off = off_ut(fit, readings)
    off = np.clip(off, -5.0 * spread_ut(fit, readings), 5.0 * spread_ut(fit, readings))
    _, place, counts = np.unique(blocks, return_inverse=True, return_counts=True)
    sums = np.bincount(place, weights=off)
    independent = float(np.sum(off**2))
    if len(counts) < 10 or not independent > 0.0:
        return 1.0
    return max(1.0, float(np.sqrt(np.sum(sums**2) / independent)))


def _align(
    recording: NodeRecording, mag_ut: Array, fit: Ellipsoid, accelerometer: Array | None
) -> tuple[MagnetometerRotation | None, tuple[str, ...]]:
    """The turn into the accelerometer's axes, or words why there is none."""
    without = "its axes are not turned into the accelerometer's, which may turn headings by a degree"
    if accelerometer is None:
        return None, (f"{without}: calibrate imu first, into the same folder",)
    level = motion_level(recording.gyr_rad_s, recording.rate_hz)
    limit = min(6.0 * stillest_level(level, floor=1e-3), _MOST_AT_REST_RAD_S)
    still = still_intervals(level, limit, recording.rate_hz, _REST_S)
    force, earth = (
        interval_means(readings @ map_[:, :3].T + map_[:, 3], still)
        for readings, map_ in ((recording.acc_m_s2, accelerometer), (mag_ut, fit.affine))
    )
    whole = np.isfinite(force).all(axis=1) & np.isfinite(earth).all(axis=1)
    try:
        return align_magnetometer(force[whole], earth[whole]), ()
    except UndeterminedError as error:
        return None, (f"{without}: {error}",)


def _check_coverage(fit: Ellipsoid, readings: Array, sigma: Array) -> None:
    seen = coverage(fit, readings)
    if seen < LEAST_COVERAGE:
        raise RecordingError(
            f"the sphere is covered too thinly: {100 * seen:.0f} % of it was seen, at least "
            f"{100 * LEAST_COVERAGE:.0f} % is needed; {_TURN}"
        )
    error = 1.96 * float(sigma[:, 3].max())
    if not error < MOST_CENTRE_ERROR * fit.field_ut:
        raise RecordingError(
            f"the sphere is covered too thinly: one side of it was not seen, and the hard iron is known to "
            f"±{error:.1f} µT only (95 %); {_TURN}"
        )


def _held_out(whole: Ellipsoid, readings: Array, blocks: NDArray[np.intp]) -> Array:
    """Calibrated strength minus the field (K,), each by a fit to the other blocks (K,) of readings."""
    _, place = np.unique(blocks, return_inverse=True)
    errors = np.empty(len(readings))
    for out in folds(int(place.max()) + 1):
        held = out[place]
        if held.any():
            fit = fit_ellipsoid(readings[~held], near=whole)
            errors[held] = fit.norms(readings[held]) - fit.field_ut
    return errors
