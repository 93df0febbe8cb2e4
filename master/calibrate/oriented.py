"""A suit's recording with every unit's orientation, from gyro and accelerometer alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, normalise, to_matrix
from master.calibrate.hinge import PoorMotionError
from master.calibrate.joint_residuals import Moving, Rows
from master.calibrate.recording import NodeRecording

_SMOOTH_HZ = 10.0
"""Low-pass of readings before the rate is differentiated."""
_SLOW_HZ = 4.0
"""Low-pass of what neighbours share: a person bends no joint faster, while skin shakes at 5 Hz and more."""
_KEPT_HZ = 20.0
"""Rate of the samples kept."""
_MOVING_RAD_S = 0.3
LONGEST_GAP_S = 0.25
"""Missing samples are bridged over no longer than that."""
_SHORTEST_S = 2.0


@dataclass(frozen=True, slots=True)
class Oriented:
    """N units, evenly sampled, T samples."""

    names: tuple[str, ...]
    rate_hz: float
    acc_m_s2: Array
    """(N, T, 3), sensor frame."""
    gyr_rad_s: Array
    """(N, T, 3), its bias taken off."""
    q: Array
    """(N, T, 4), own earth frame (z up, arbitrary heading) from sensor."""

    def some(self, names: Sequence[str]) -> Oriented:
        """Only these units."""
        rows = [self.names.index(name) for name in names]
        return Oriented(tuple(names), self.rate_hz, self.acc_m_s2[rows], self.gyr_rad_s[rows], self.q[rows])


def orient(recordings: Mapping[str, NodeRecording], names: Sequence[str]) -> Oriented:
    """Orientations by offline VQF (Laidig and Seel 2023), six axes: inclination right, heading arbitrary.

    Short gaps are bridged. Raises PoorMotionError for long ones, and for a recording of a moment.
    """
    from vqf import offlineVQF  # no wheels for aarch64 nor Python 3.14: only who calibrates needs it

    rates = {recordings[name].rate_hz for name in names}
    if max(rates) - min(rates) > 0.01 * max(rates):
        raise PoorMotionError(f"the nodes were recorded at different rates ({sorted(rates)} Hz)")
    rate_hz = float(np.median(list(rates)))
    length = min(len(recordings[name].gyr_rad_s) for name in names)
    if length < _SHORTEST_S * rate_hz:
        raise PoorMotionError(f"{length / rate_hz:.1f} s are too short: record 20 s or more")
    acc, gyr, q = [], [], []
    for name in names:
        a = bridged(recordings[name].acc_m_s2[:length], name, rate_hz)
        g = bridged(recordings[name].gyr_rad_s[:length], name, rate_hz)
        out = offlineVQF(g, a, None, 1.0 / rate_hz)
        acc.append(a)
        gyr.append(g - out["bias"])
        q.append(normalise(out["quat6D"]))
    return Oriented(tuple(names), rate_hz, np.stack(acc), np.stack(gyr), np.stack(q))


def moving(suit: Oriented, zero_pose: slice) -> tuple[list[Moving], float]:
    """Each unit over the recording at some 20 Hz, low-passed, and the spacing of these samples, s."""
    # a fast recording is thinned out as soon as its low-pass lets it
    first = max(1, round(suit.rate_hz / (5.0 * _SMOOTH_HZ)))
    middle_hz = suit.rate_hz / first
    second = max(1, round(middle_hz / _KEPT_HZ))
    units = []
    for acc, gyr, q in zip(suit.acc_m_s2, suit.gyr_rad_s, suit.q, strict=True):
        smooth = _lowpass(np.concatenate([gyr, acc], axis=1), _SMOOTH_HZ, suit.rate_hz)[::first]
        rate, force, r = smooth[:, :3], smooth[:, 3:], to_matrix(q[::first])
        spin = _cross_matrices(rate)
        lever = _cross_matrices(np.gradient(rate, 1.0 / middle_hz, axis=0)) + spin @ spin
        in_earth = r @ np.concatenate([rate[..., None], force[..., None], lever], axis=2)
        slow = _lowpass(in_earth.reshape(-1, 15), _SLOW_HZ, middle_hz)[::second].reshape(-1, 3, 5)
        mean = to_matrix(mean_rotation(q[zero_pose]))
        units.append(Moving(r[::second], slow[..., 0], slow[..., 1], slow[..., 2:], mean))
    return units, first * second / suit.rate_hz


def _lowpass(values: Array, cutoff_hz: float, rate_hz: float) -> Array:
    """Butterworth of order 2, forwards and backwards: no delay. Values (T, C)."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, min(cutoff_hz, 0.4 * rate_hz), fs=rate_hz, output="sos")
    out: Array = sosfiltfilt(sections, values, axis=0)
    return out


def rows_moving(parent: Moving, child: Moving) -> Rows:
    """Samples in which either unit of a pair turns."""
    rate = np.maximum(np.linalg.norm(parent.rate, axis=1), np.linalg.norm(child.rate, axis=1))
    return np.flatnonzero(rate > _MOVING_RAD_S)


def mean_rotation(q: Array) -> Array:
    """The mean (4,) of rotations (T, 4) near each other: the main direction of their outer products."""
    return np.asarray(np.linalg.eigh(q.T @ q)[1][:, -1])


def _cross_matrices(v: Array) -> Array:
    out = np.zeros((*v.shape, 3))
    x, y, z = np.moveaxis(v, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def longest_gap(values: Array) -> int:
    """Samples from the last reading (T, 3) to the next where most are missing between; T + 1 without any."""
    at = np.flatnonzero(np.isfinite(values).all(axis=1))
    return int(np.max(np.diff(np.concatenate([[-1], at, [len(values)]]))))


def bridged(values: Array, name: str, rate_hz: float) -> Array:
    """Missing samples drawn straight from the last to the next."""
    there = np.isfinite(values).all(axis=1)
    if there.all():
        return np.ascontiguousarray(values, dtype=np.float64)
    at = np.flatnonzero(there)
    if len(at) < 2 or longest_gap(values) > max(2.0, LONGEST_GAP_S * rate_hz):
        raise PoorMotionError(f"{name}: samples are missing for more than {LONGEST_GAP_S:g} s; record again")
    every = np.arange(len(values))
    return np.stack([np.interp(every, at, column[at]) for column in values.T], axis=-1)
