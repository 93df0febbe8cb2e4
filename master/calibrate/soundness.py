"""Whether a recording can be calibrated from at all: missing, constant, zero and clipped readings.

Each refusal says what is wrong and what to do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from master.calibrate.recording import NodeRecording, RecordingError
from master.calibrate.still import runs

_MOST_MISSING = 0.1
_CLIPPED_S = 0.06
_CLIPPED_RUN = 3
"""So many equal readings in a row at the end of the range are no coincidence while the node turns."""
_NOISY_RUN = 2
"""So many equal largest readings in a row are none either while the reading is noisy."""
_SAME = 1e-6
"""Relative difference up to which two readings are the same: a recording in single precision."""
_AXES = "xyz"


def check_samples(sensor: str, samples: Array, missing: float | None = None) -> None:
    """Refuse readings (T, 3) of which too many are missing, or an axis of which never changes.

    `missing` is the share that is missing of a sensor with a rate of its own.
    """
    if missing is None:
        missing = float(np.mean(~np.isfinite(samples).all(axis=1)))
    if missing > _MOST_MISSING:
        raise RecordingError(
            f"{100 * missing:.0f} % of the {sensor}'s readings are missing (NaN); look at the cable or the "
            "bus, and record again"
        )
    constant = np.nanmax(samples, axis=0) == np.nanmin(samples, axis=0)
    if constant.any():
        axes = ", ".join(a for a, c in zip(_AXES, constant, strict=True) if c)
        raise RecordingError(
            f"the {sensor} reads the same all along on {axes}; it is broken or not connected"
        )


def without_zeros(recording: NodeRecording) -> NodeRecording:
    """The recording without accelerometer readings of zero on all axes: under gravity there are none.

    Not so for raw counts, of which zero is the end of the range.
    """
    zeros = np.all(recording.acc_m_s2 == 0.0, axis=1)
    if recording.counts or not zeros.any() or zeros.mean() > _MOST_MISSING:
        return recording
    force = np.where(zeros[:, None], np.nan, recording.acc_m_s2)
    note = f"{int(zeros.sum())} accelerometer readings of zero on all axes dropped"
    return replace(recording, acc_m_s2=force, notes=(*recording.notes, note))


def check_clipped(sensor: str, samples: Array, watched: Mask, shortest: int, remedy: str) -> None:
    """Refuse readings (T, 3) that stay at an end of their range for `shortest` samples while `watched`."""
    for name, values in zip(_AXES, samples.T, strict=True):
        for end in (np.nanmax(values), np.nanmin(values)):
            at_end = (values == end) & watched
            if np.max(np.diff(runs(at_end)), initial=0) >= shortest:
                raise RecordingError(
                    f"the {sensor} is clipped on {name}: {int(at_end.sum())} readings are at its limit "
                    f"of {end:g}; {remedy}"
                )


def check_inertial(recording: NodeRecording, level: Array, fast: float) -> None:
    """Refuse a clipped sensor, for the gyro's `level` (T,), above `fast` while the node surely turns."""
    turning = level > fast
    check_clipped(
        "gyroscope",
        recording.gyr_rad_s,
        turning,
        # whole counts hold the very top of a slow turn for three samples now and then
        max(_CLIPPED_RUN, round(_CLIPPED_S * recording.rate_hz)),
        "turn the node more slowly, and record again",
    )
    if _noisy(recording.acc_m_s2, ~turning):
        check_clipped(
            "accelerometer",
            recording.acc_m_s2,
            ~turning,
            max(_CLIPPED_RUN, round(0.5 * recording.rate_hz)),
            "set a larger range, or replace the node",
        )


def _noisy(samples: Array, watched: Mask) -> bool:
    """Whether noise moves most axes of readings (T, 3) all the time, away from the ends of their range.

    A perfect sensor, as in a simulation, stands still at rest, and then nothing tells that it is clipped.
    """
    inside = (samples < np.nanmax(samples, axis=0)) & (samples > np.nanmin(samples, axis=0))
    both = inside[1:] & inside[:-1] & (watched[1:] & watched[:-1])[:, None]
    moved = np.where(both, np.abs(np.diff(samples, axis=0)), np.nan)
    axes = [column[np.isfinite(column)] for column in moved.T]
    return float(np.median([np.median(axis) if len(axis) else 0.0 for axis in axes])) > 0.0


def filled(samples: Array, longest: int) -> Array:
    """Gaps of at most `longest` samples bridged by straight lines, (T, 3); longer ones stay NaN."""
    missing = np.any(~np.isfinite(samples), axis=1)
    if not missing.any():
        return samples
    known = np.flatnonzero(~missing)
    out = np.where(missing[:, None], np.nan, samples)
    for a, b in runs(missing):
        if b - a <= longest and a > 0 and b < len(samples):
            for axis in range(3):
                out[a:b, axis] = np.interp(np.arange(a, b), known, samples[known, axis])
    return out


def clipped(samples: Array, least: float, run: int = _NOISY_RUN) -> Mask:
    """Which of the readings (T, 3) stand at an end of their axis's range, (T,).

    An end beyond `least` is one where the extreme value comes in a `run`: what a converter limits is flat,
    what a person moves is a peak. Missing readings are not clipped.
    """
    out = np.zeros(len(samples), dtype=np.bool_)
    for values in samples.T:
        if not np.isfinite(values).any():
            continue
        for end in (float(np.nanmax(values)), float(np.nanmin(values))):
            if abs(end) < least:
                continue
            at = np.abs(values - end) <= _SAME * abs(end)
            for begin, stop in runs(at):
                out[begin:stop] |= stop - begin >= run
    return out


def range_ends(samples: Array, where: Mask) -> str:
    """The axes that were clipped and at which value, for a message."""
    bounds = []
    for name, values in zip(_AXES, samples.T, strict=True):
        if not where.any() or not np.isfinite(values).any():
            continue
        for end in (float(np.nanmax(values)), float(np.nanmin(values))):
            at = np.abs(values - end) <= _SAME * abs(end)
            if int((at & where).sum()) >= _NOISY_RUN:
                bounds.append(f"{name} at {end:.4g}")
    return ", ".join(bounds)
