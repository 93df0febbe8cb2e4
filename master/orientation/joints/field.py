"""What the magnetometers say of the headings, and how far that is to be believed where there is iron."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

_UNNOTICED_UT = 0.5
"""What noise and inclination errors alone make of a field's strength and dip."""
_REFERENCE_S = 60.0
"""Time constant with which the usual field follows the suit's, should the operator walk elsewhere."""


class MagneticHeadings:
    """Headings of N nodes by their magnetometers, with variances that grow where the field is disturbed.

    A disturbance adds a vector of unknown direction to the earth's field. Its parts along magnetic north and
    the vertical show, as another strength and dip than the whole suit's median; the part to the east shows
    only against the heading that gyros and joints foretell. Each part has about the same size, so what shows
    tells the variance of the heading. A place that disturbed a moment ago may be met again: the largest
    disturbance met is forgotten with the time constant `memory_s`.
    """

    def __init__(self, count: int, memory_s: float) -> None:
        self._memory_s = memory_s
        self._usual_ut = np.full(2, np.nan)
        self._disturbance_ut2 = np.zeros(count)
        self.north_rad: Array = np.zeros(count)
        """(N,) by how much north is west of where each magnetometer says, as far as a zero pose told."""

    def direction(self, mag_world_ut: Array) -> Array:
        """Heading errors θ (N,), rad, that bring fields (N, 3) to where north is; NaN without one."""
        out: Array = 0.5 * math.pi - np.arctan2(mag_world_ut[:, 1], mag_world_ut[:, 0]) - self.north_rad
        return out

    def set_north(self, nodes: Mask, theta_rad: Array, mag_world_ut: Array) -> None:
        """Take θ (N,) of some nodes as known: north is where most of their magnetometers then say.

        The median, so that the few that stand near iron do not count.
        """
        self._disturbance_ut2[nodes] = 0.0
        self.north_rad[nodes] = 0.0
        away = wrap(self.direction(mag_world_ut) - theta_rad)[nodes]
        away = away[np.isfinite(away)]
        if len(away):
            # angles about a middle of their own, or a median across ±π would fall between
            middle = math.atan2(np.sin(away).sum(), np.cos(away).sum())
            self.north_rad[nodes] = middle + np.median(wrap(away - middle))

    def restart(self, nodes: Mask) -> None:
        """Forget what disturbed some nodes, mask (N,)."""
        self._disturbance_ut2[nodes] = 0.0

    def measure(
        self, mag_world_ut: Array, theta_rad: Array, variance: Array, dt_s: float
    ) -> tuple[Array, Array]:
        """How far the fields (N, 3) turn from what θ (N,) foretells, rad, and the variance of that, rad².

        `variance` (N,) is that of θ. Without a magnetometer (NaN) the first is 0 and the second infinite.
        """
        level_ut = np.hypot(mag_world_ut[:, 0], mag_world_ut[:, 1])
        seen = np.stack([level_ut, mag_world_ut[:, 2]])
        there = np.isfinite(level_ut)
        if not there.any():
            return np.zeros(len(theta_rad)), np.full(len(theta_rad), np.inf)
        self._follow(np.median(seen[:, there], axis=1), dt_s)
        usual_level_ut = max(self._usual_ut[0], 1.0)
        away = np.where(there, wrap(self.direction(mag_world_ut) - theta_rad), 0.0)
        east_ut2 = np.maximum(away**2 - variance, 0.0) * usual_level_ut**2
        other = np.sum((seen - self._usual_ut[:, None]) ** 2, axis=0) + east_ut2
        now = np.where(there, np.maximum(0.5 * other - _UNNOTICED_UT**2, 0.0), 0.0)
        self._disturbance_ut2 *= math.exp(-dt_s / self._memory_s)
        np.maximum(self._disturbance_ut2, now, out=self._disturbance_ut2)
        return away, np.where(there, self._disturbance_ut2 / usual_level_ut**2, np.inf)

    def _follow(self, median_ut: Array, dt_s: float) -> None:
        if math.isnan(self._usual_ut[0]):
            self._usual_ut = median_ut
        self._usual_ut = self._usual_ut + min(dt_s / _REFERENCE_S, 1.0) * (median_ut - self._usual_ut)


def wrap(angle_rad: Array) -> Array:
    """Angles to [-π, π)."""
    out: Array = (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
    return out
