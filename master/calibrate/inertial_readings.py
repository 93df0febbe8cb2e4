"""The readings of one node as both inertial calibrations begin with them, and a record of the result."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

import numpy as np

from common.config.sensor_calibration import Made
from common.quaternion import Array
from master.calibrate import inertial_evidence as compare
from master.calibrate.evidence import CrossCheck, refuse_contradictions
from master.calibrate.recording import NodeRecording
from master.calibrate.soundness import check_inertial, check_samples, filled, without_zeros
from master.calibrate.still import motion_level, stillest_level

STANDARD_GRAVITY_M_S2 = 9.80665
_LONGEST_GAP_S = 0.05
_CLIP_WATCH = 40.0
"""Only what turns this many times faster than rest can be at the end of a gyro's range."""


@dataclass(frozen=True, slots=True)
class InertialReadings:
    """One node's recording, found sound."""

    recording: NodeRecording
    rates: Array
    """(T, 3) of the gyroscope, short gaps bridged, in the unit of the readings."""
    level: Array
    """(T,) how fast the node turns, in the same unit; see `motion_level`."""
    rest: float
    """That level of a node at rest."""
    evidence: tuple[CrossCheck, ...]

    def force_bridged(self) -> Array:
        """(T, 3) of the accelerometer, short gaps bridged."""
        return _bridged(self.recording.acc_m_s2, self.recording.rate_hz)


def sound_readings(recording: NodeRecording, gravity_m_s2: float) -> InertialReadings:
    """Check a recording before anything is fitted. Raises RecordingError, saying what to do."""
    recording = without_zeros(recording)
    check_samples("accelerometer", recording.acc_m_s2)
    check_samples("gyroscope", recording.gyr_rad_s)
    evidence: tuple[CrossCheck, ...] = ()
    if not recording.counts:
        norms = np.linalg.norm(recording.acc_m_s2, axis=1)
        evidence = (compare.known_unit(float(np.median(norms[np.isfinite(norms)])), gravity_m_s2),)
        refuse_contradictions(evidence)
    rates = _bridged(recording.gyr_rad_s, recording.rate_hz)
    level = motion_level(rates, recording.rate_hz)
    rest = stillest_level(level, floor=1.0 if recording.counts else 1e-3)
    check_inertial(recording, level, _CLIP_WATCH * rest)
    evidence += refuse_contradictions(compare.ranges(recording, rates[level < 2.0 * rest]))
    return InertialReadings(recording, rates, level, rest, evidence)


def made(
    day: date, recording: str, unit: str, before: Array, after: Array, sigma: Array, held: Array | None = None
) -> Made:
    """The record of one part: mean residuals before and after, on data `held` out, and the 1σ of the map."""
    hold_out = np.nan if held is None else float(np.mean(np.abs(held)))
    return Made(
        date=day,
        recording=recording,
        unit=unit,
        residual_before=float(np.mean(np.abs(before))),
        residual_after=float(np.mean(np.abs(after))),
        hold_out=hold_out if np.isfinite(hold_out) else None,
        sigma=sigma.tolist(),
    )


def _bridged(samples: Array, rate_hz: float) -> Array:
    return filled(samples, round(_LONGEST_GAP_S * rate_hz))
