"""Accelerometer and gyroscope of one node from a session of many attitudes (paper B, 2.2.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import date

import numpy as np

from common.config.sensor_calibration import Made
from common.quaternion import Array
from master.calibrate import accelerometer as acc
from master.calibrate import gyroscope as gyr
from master.calibrate import inertial_evidence as compare
from master.calibrate.evidence import CrossCheck, refuse_contradictions
from master.calibrate.inertial_readings import STANDARD_GRAVITY_M_S2, made, sound_readings
from master.calibrate.node_file import Part
from master.calibrate.recording import NodeRecording, RecordingError
from master.calibrate.still import (
    THRESHOLDS,
    Intervals,
    distinct_attitudes,
    interval_means,
    still_intervals,
)
from master.calibrate.turns import moving_readings

FEWEST_STILL = 12
FEWEST_ATTITUDES = 9
FEWEST_MOVES = 9
PAPER_ATTITUDES = 20
_AS_GOOD = 1.2
"""A threshold whose residual is within this ratio of the best one's is as good; the lowest such is taken."""
_LONGEST_MOVE_S = 30.0
_TRIAL_ERROR_M_S2 = 0.01
_WORST_GAIN, _WORST_BIAS_M_S2 = 0.02, 0.1
"""What an error of that size in every still interval may make of the fit."""
_WORST_GYRO_GAIN = 0.02
_MOST_COMMON_GAIN = 0.1
"""Makers keep to 3 % (MPU-6050); a wrong rate is a factor on all axes."""
_ONE_DEGREE = np.pi / 180.0
_HOPELESS_ERROR_RAD = 30.0 * _ONE_DEGREE
"""Of gravity after a move, on average, with the best single scale."""


@dataclass(frozen=True, slots=True)
class InertialOptions:
    """What a person may choose."""

    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    """At the place of the recording."""
    shortest_still_s: float = 2.0
    """A shorter rest is none. The paper asks for 10 s; 2 s average the noise of these sensors well."""


@dataclass(frozen=True, slots=True)
class InertialCalibration:
    """What was found, and how good it is."""

    name: str
    still: Intervals
    """(K, 2) samples."""
    attitudes: int
    """Distinct ones among the still intervals."""
    accelerometer: acc.AccelerometerFit
    gyroscope: gyr.GyroscopeFit
    acc_before_m_s2: Array
    """(K,), ‖a‖ - g of each still interval with the readings as they came."""
    gyr_before_rad: Array
    """(M,), the gravity error of each move with only the bias taken off."""
    counts: bool
    """The maps take raw counts."""
    notes: tuple[str, ...] = field(default=())
    evidence: tuple[CrossCheck, ...] = ()
    """What was compared before this was believed."""

    def parts(self, day: date, recording: str) -> dict[Part, tuple[Array, Made]]:
        """As `write_calibration` takes them."""
        a, g = self.accelerometer, self.gyroscope
        acc_made = made(
            day, recording, "m/s²", self.acc_before_m_s2, a.residuals_m_s2, a.affine_sigma, a.hold_out_m_s2
        )
        gyr_made = made(
            day, recording, "rad", self.gyr_before_rad, g.errors_rad, g.affine_sigma, g.hold_out_rad
        )
        return {"accelerometer": (a.affine, acc_made), "gyroscope": (g.affine, gyr_made)}


def calibrate_inertial(
    recording: NodeRecording,
    options: InertialOptions = InertialOptions(),
    progress: Callable[[float], None] = lambda share: None,
) -> InertialCalibration:
    """Find the maps of both sensors. Raises RecordingError when the recording does not determine them.

    `progress` hears what share is done.
    """
    sound = sound_readings(recording, options.gravity_m_s2)
    recording, rates, gravity = sound.recording, sound.rates, options.gravity_m_s2
    evidence = [*sound.evidence]
    still, readings, first = _best_stills(recording, sound.level, sound.rest, options)
    fit = acc.fit_accelerometer(readings, gravity, first)
    attitudes = _check_attitudes(fit, readings, gravity)
    progress(0.1)
    moves, still_rates = _moves(recording, rates, still, readings @ fit.gain.T + fit.gain @ fit.bias)
    scale, axes = _gyro_unit(moves, counts=recording.counts)
    evidence += [axes, *compare.found_accelerometer(fit, gravity, counts=recording.counts)]
    refuse_contradictions(evidence)
    progress(0.2)
    held = np.concatenate([rates[a:b] for a, b in still])
    noise = np.nanstd(held, axis=0) / np.sqrt(len(held))
    turned = gyr.fit_gyroscope(moves, still_rates, noise, scale, lambda share: progress(0.2 + 0.8 * share))
    # the gyroscope's axes are the accelerometer's, which are not known exactly either
    of_axes = float(fit.sigma[[1, 2, 4]].max()) / float(np.cbrt(np.linalg.det(fit.gain))) * scale
    turned = replace(turned, gain_cov=turned.gain_cov + of_axes**2 * np.eye(gyr.UNKNOWNS))
    found = compare.found_gyroscope(turned, scale)
    # what does not fit, then what is not determined, then what is not plausible
    refuse_contradictions(found[:1])
    _check_gyro(turned, scale, counts=recording.counts)
    evidence += refuse_contradictions(found)
    plain = acc.nominal(readings, gravity, counts=recording.counts)
    return InertialCalibration(
        name=recording.name,
        still=still,
        attitudes=attitudes,
        accelerometer=fit,
        gyroscope=turned,
        acc_before_m_s2=acc.norm_errors(plain, readings, gravity),
        gyr_before_rad=gyr.gravity_errors(scale * np.eye(3), moves),
        counts=recording.counts,
        notes=(*recording.notes, *_notes(recording, attitudes, len(moves.counts), len(still) - 1)),
        evidence=tuple(evidence),
    )


def _best_stills(
    recording: NodeRecording, level: Array, rest: float, options: InertialOptions
) -> tuple[Intervals, Array, Array]:
    """Still intervals, their mean readings (K, 3) and θ there, of the best threshold (Tedaldi 2014)."""
    found = []
    most = 0
    for threshold in THRESHOLDS:
        still = still_intervals(level, threshold * rest, recording.rate_hz, options.shortest_still_s)
        # where the accelerometer alone is missing there is no attitude
        still = still[[np.isfinite(recording.acc_m_s2[a:b]).all(axis=1).any() for a, b in still]]
        most = max(most, len(still))
        if len(still) < FEWEST_STILL:
            continue
        readings = interval_means(recording.acc_m_s2, still)
        if not recording.counts:
            at_rest = float(np.median(np.linalg.norm(readings, axis=1)))
            refuse_contradictions([compare.acceleration_unit(at_rest, options.gravity_m_s2)])
        first = acc.start(readings, options.gravity_m_s2, counts=recording.counts)
        theta = acc.solve(readings, options.gravity_m_s2, first)
        error = float(np.mean(np.abs(acc.norm_errors(theta, readings, options.gravity_m_s2))))
        found.append((distinct_attitudes(_unit(readings + theta[6:])), error, still, readings, theta))
    if not found:
        raise RecordingError(
            f"too few attitudes: {most} rests of {options.shortest_still_s:g} s or more were found, at least "
            f"{FEWEST_STILL} are needed; lay the node down in {PAPER_ATTITUDES} or more attitudes, "
            "some seconds each"
        )
    attitudes = max(f[0] for f in found)
    candidates = [f for f in found if f[0] >= 0.9 * attitudes]
    best = min(f[1] for f in candidates)
    _, _, still, readings, theta = next(f for f in candidates if f[1] <= _AS_GOOD * best)
    return still, readings, theta


def _check_attitudes(fit: acc.AccelerometerFit, readings: Array, gravity_m_s2: float) -> int:
    # first whether the fit is one at all: directions by a fit that is none cannot be counted
    gain, bias = acc.determined(fit.theta, readings, gravity_m_s2, _TRIAL_ERROR_M_S2)
    if not (gain < _WORST_GAIN and bias < _WORST_BIAS_M_S2):
        raise RecordingError(
            "the attitudes are too similar to find the accelerometer's nine unknowns; "
            "lay the node down on every face, also upside down, and on edges between them"
        )
    attitudes = distinct_attitudes(_unit((readings + fit.bias) @ fit.gain.T))
    if attitudes < FEWEST_ATTITUDES:
        raise RecordingError(
            f"too few attitudes: {attitudes} distinct ones (10° apart), at least {FEWEST_ATTITUDES} are "
            f"needed; lay the node down in {PAPER_ATTITUDES} or more, on every face and on edges between them"
        )
    return attitudes


def _moves(recording: NodeRecording, rates: Array, still: Intervals, force: Array) -> tuple[gyr.Moves, Array]:
    """The moves between rests that follow one another, and the mean rate of each rest (K, 3)."""
    still_rates = interval_means(rates, still)
    bias = still_rates.mean(axis=0)
    between = np.column_stack([still[:-1, 1], still[1:, 0]])
    short = between[:, 1] - between[:, 0] <= _LONGEST_MOVE_S * recording.rate_hz
    whole = np.array([np.isfinite(rates[a : b + 1]).all() for a, b in between])
    used = short & whole
    if used.sum() < FEWEST_MOVES:
        raise RecordingError(
            f"too few moves: {int(used.sum())} of {_LONGEST_MOVE_S:g} s or less without a gap between two "
            f"rests, at least {FEWEST_MOVES} are needed; turn the node from rest to rest without delay"
        )
    pairs, counts = moving_readings(rates - bias, between[used])
    gravity = _unit(force)
    return gyr.Moves(
        pairs, counts, gravity[:-1][used], gravity[1:][used], 1.0 / recording.rate_hz
    ), still_rates


def _gyro_unit(moves: gyr.Moves, *, counts: bool) -> tuple[float, CrossCheck]:
    """rad/s of one unit of the readings, 1 where they are in rad/s, and what gravity says of the axes.

    Refused where neither another unit nor other axes explain it.
    """
    scale = gyr.nominal_scale(moves) if counts else 1.0
    plain = float(np.mean(gyr.gravity_errors(scale * np.eye(3), moves)))
    axes = compare.gyroscope_axes(moves, scale, counts=counts)
    if plain < compare.PLAUSIBLE_ERROR_RAD or axes.verdict == "contradicts":
        return scale, axes
    scale = gyr.nominal_scale(moves)
    error = float(np.mean(gyr.gravity_errors(scale * np.eye(3), moves)))
    if error > _HOPELESS_ERROR_RAD:
        raise RecordingError(
            f"the gyroscope does not explain how gravity turns ({error / _ONE_DEGREE:.0f}° off on average); "
            "were samples lost, or are its axes not the accelerometer's?"
        )
    if counts:
        return scale, axes
    if 0.8 < scale / _ONE_DEGREE < 1.25:
        raise RecordingError("the gyroscope's readings are in °/s, not rad/s; multiply them by π/180")
    if not 0.8 < scale < 1.25:
        raise RecordingError(
            f"gravity turns {scale:.2g} times as far as the gyroscope says; is the rate of the recording "
            "right, and are the readings in rad/s?"
        )
    return 1.0, axes


def _check_gyro(fit: gyr.GyroscopeFit, scale: float, *, counts: bool) -> None:
    worst = float(fit.sigma.max()) / scale
    if not worst < _WORST_GYRO_GAIN:
        raise RecordingError(
            f"the moves do not determine the gyroscope's matrix (1σ of {100 * worst:.0f} %); "
            "turn the node about each of its axes, a quarter turn or more each time"
        )
    gain = float(np.cbrt(np.linalg.det(fit.gain))) / scale
    if not counts and abs(gain - 1.0) > _MOST_COMMON_GAIN:
        raise RecordingError(
            f"all of the gyroscope's gains are off together by a factor of {gain:.2f}, "
            "more than a sensor's are; is the rate of the recording right?"
        )


def _notes(recording: NodeRecording, attitudes: int, moves: int, between: int) -> tuple[str, ...]:
    notes = []
    if attitudes < PAPER_ATTITUDES:
        notes.append(f"{attitudes} distinct attitudes; {PAPER_ATTITUDES} or more make it surer")
    if moves < between:
        notes.append(f"{between - moves} of {between} moves left out: too long, or with samples missing")
    if recording.counts:
        notes.append("the readings are raw counts: the maps take counts to m/s² and rad/s")
    return tuple(notes)


def _unit(v: Array) -> Array:
    out: Array = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return out
