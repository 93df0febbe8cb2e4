"""Energy of angular velocity and acceleration in three bands of frequency. Pure.

A cubic spline lays every stage on one grid of 200 Hz, so that a stage of 12.5 Hz can be compared with one of
200 Hz. The faster one is first taken at the instants of the slower one: so its fast motion is folded into the
slow one's band as it is in the slower one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array

GRID_HZ = 200.0
MOTION_HZ, JITTER_HZ = 3.0, 15.0
"""What people do on purpose is below 3 Hz; what shakes a robot's arm is up to 15 Hz; the rest is above."""
WINDOW_S = 5.0
"""Of one periodogram: it tells 0.2 Hz apart, so that 3 Hz is an edge."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One stage: angles of C channels at T instants of one clock."""

    stage: str
    channels: tuple[str, ...]
    """(C,) a joint's or node's name; three in a row may bear one, for the axes."""
    time_s: Array
    """(T,) rising."""
    angle_rad: Array
    """(T, C). Of a node the integral of its rate: only its derivative is looked at."""
    between: Signal | None = None
    """The same motion as rotations of segments against their neighbours, where a stage of segments meets one
    of joints."""

    @property
    def rate_hz(self) -> float:
        """By the median step."""
        return float(1.0 / np.median(np.diff(self.time_s)))

    def within(self, from_s: float, until_s: float) -> Signal:
        """The part between two instants."""
        inside = (self.time_s >= from_s) & (self.time_s <= until_s)
        between = None if self.between is None else self.between.within(from_s, until_s)
        return Signal(self.stage, self.channels, self.time_s[inside], self.angle_rad[inside], between)

    def at(self, time_s: Array) -> Signal:
        """As if it had been sampled at these instants only."""
        from scipy.interpolate import CubicSpline

        angle_rad: Array = CubicSpline(self.time_s, self.angle_rad)(time_s)
        between = None if self.between is None else self.between.at(time_s)
        return Signal(self.stage, self.channels, time_s, angle_rad, between)


@dataclass(frozen=True, slots=True)
class Bands:
    """RMS by name of the channel, over its axes: rad/s below 3 Hz, from 3 to 15 Hz, above."""

    velocity_rad_s: dict[str, tuple[float, float, float]]
    acceleration_rad_s2: dict[str, tuple[float, float, float]]

    def jitter(self, channel: str) -> float:
        """RMS angular velocity between 3 and 15 Hz, rad/s."""
        return self.velocity_rad_s[channel][1]

    def motion(self, channel: str) -> float:
        """RMS angular velocity below 3 Hz, rad/s."""
        return self.velocity_rad_s[channel][0]

    @property
    def total(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Angular velocity and acceleration over all channels: the root of the sum of their squares."""
        return _root_sum(self.velocity_rad_s), _root_sum(self.acceleration_rad_s2)


def _root_sum(table: dict[str, tuple[float, float, float]]) -> tuple[float, float, float]:
    low, middle, high = (float(v) for v in np.sqrt((np.array(list(table.values())) ** 2).sum(axis=0)))
    return low, middle, high


def bands(signal: Signal) -> Bands:
    """The three bands of a signal of at least 2 s. What lies above half its own rate is the spline's."""
    frequency_hz, density = spectrum(signal)
    step_hz = float(frequency_hz[1] - frequency_hz[0])
    squared_rate = (2.0 * np.pi * frequency_hz[:, None]) ** 2
    masks = (
        frequency_hz < MOTION_HZ,
        (frequency_hz >= MOTION_HZ) & (frequency_hz < JITTER_HZ),
        frequency_hz >= JITTER_HZ,
    )
    velocity = np.array([density[mask].sum(axis=0) * step_hz for mask in masks])
    acceleration = np.array([(density * squared_rate)[mask].sum(axis=0) * step_hz for mask in masks])
    return Bands(_by_channel(signal.channels, velocity), _by_channel(signal.channels, acceleration))


def spectrum(signal: Signal) -> tuple[Array, Array]:
    """Frequencies (F,) in Hz and the density of angular velocity (F, C) in (rad/s)²/Hz, by Welch's method."""
    from scipy.interpolate import CubicSpline
    from scipy.signal import welch

    grid_s = np.arange(signal.time_s[0], signal.time_s[-1], 1.0 / GRID_HZ)
    rate_rad_s = CubicSpline(signal.time_s, signal.angle_rad)(grid_s, 1)
    length = min(len(grid_s), int(WINDOW_S * GRID_HZ))
    frequency_hz, density = welch(rate_rad_s, GRID_HZ, nperseg=length, axis=0)
    return np.asarray(frequency_hz), np.asarray(density)


def _by_channel(channels: tuple[str, ...], energy: Array) -> dict[str, tuple[float, float, float]]:
    sums: dict[str, Array] = {}
    for column, name in enumerate(channels):
        sums[name] = sums.get(name, np.zeros(3)) + energy[:, column]
    return {
        name: (float(np.sqrt(e[0])), float(np.sqrt(e[1])), float(np.sqrt(e[2]))) for name, e in sums.items()
    }
