"""Movements that repeat, as walking does, blended in from standing still and out again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from common.errors import TandemError
from common.quaternion import Array


@dataclass(frozen=True, slots=True)
class Curve:
    """A joint's angle over one stride, mean + Σ cos_rad[k] cos(k φ) + sin_rad[k] sin(k φ), k from 1."""

    mean_rad: float
    cos_rad: tuple[float, ...]
    sin_rad: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Strides:
    """When it happens: still until `start_s`, in full from `ramp_s` later, and still again from `stop_s`."""

    period_s: float
    start_s: float
    stop_s: float
    ramp_s: float
    stride_s: float


class GaitError(TandemError):
    """A gait that cannot be walked: of no known joint, or with times out of order."""


class Gait:
    """A periodic motion of J named joints: stand still in the zero pose, walk, stand still.

    θ(t) = w(t) g(φ(t)): g is the joint's Fourier series, φ runs on evenly at one turn a stride, and w rises
    from 0 to 1 and falls back on the minimum-jerk course 10 u³ − 15 u⁴ + 6 u⁵. So position, velocity and
    acceleration are continuous everywhere, and the derivatives exact.
    """

    def __init__(
        self, joint_names: Sequence[str], curves: Mapping[str, tuple[Curve, float]], strides: Strides
    ) -> None:
        """A curve for each joint that moves, and by what share of a stride it is ahead. Raises GaitError."""
        _check(joint_names, curves, strides)
        self.period_s = strides.period_s
        self._strides = strides
        most = max((max(len(c.cos_rad), len(c.sin_rad)) for c, _ in curves.values()), default=0)
        # one complex amplitude a joint and harmonic: its real part times exp(i k φ) is the series
        self._amplitude = np.zeros((len(joint_names), most + 1), dtype=np.complex128)
        for joint, (curve, ahead) in curves.items():
            row = self._amplitude[joint_names.index(joint)]
            row[0] = curve.mean_rad
            row[1 : 1 + len(curve.cos_rad)] += curve.cos_rad
            row[1 : 1 + len(curve.sin_rad)] -= 1j * np.array(curve.sin_rad)
            row *= np.exp(2j * math.pi * ahead * np.arange(most + 1))
        self._pulse_rad_s = 2.0 * math.pi / strides.stride_s * np.arange(most + 1)

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""
        t = np.mod(np.asarray(t_s, dtype=np.float64), self.period_s)[..., None]
        turning = np.exp(1j * self._pulse_rad_s * (t - self._strides.start_s))
        i_pulse = 1j * self._pulse_rad_s
        g, g1, g2 = (((turning * i_pulse**k) @ self._amplitude.T).real for k in range(3))
        w, w1, w2 = self._blend(t)
        return w * g, w1 * g + w * g1, w2 * g + 2.0 * w1 * g1 + w * g2

    def _blend(self, t: Array) -> tuple[Array, Array, Array]:
        """The weight w and its two derivatives."""
        strides = self._strides
        rising = t < 0.5 * (strides.start_s + strides.stop_s)
        since = np.where(rising, t - strides.start_s, strides.stop_s - t)
        towards = np.where(rising, 1.0, -1.0)
        u = np.clip(since / strides.ramp_s, 0.0, 1.0)
        rest = 1.0 - u
        return (
            u**3 * (10.0 + u * (6.0 * u - 15.0)),
            towards / strides.ramp_s * 30.0 * (u * rest) ** 2,
            60.0 * u * rest * (rest - u) / strides.ramp_s**2,
        )


def _check(joint_names: Sequence[str], curves: Mapping[str, object], strides: Strides) -> None:
    for joint in curves:
        if joint not in joint_names:
            raise GaitError(f"a curve of {joint}, which is none of the skeleton's joints")
    if not (strides.stride_s > 0.0 and strides.ramp_s > 0.0):
        raise GaitError("stride_s and ramp_s must be more than 0")
    if not 0.0 <= strides.start_s <= strides.stop_s - 2.0 * strides.ramp_s:
        raise GaitError("from start_s to stop_s must leave time for ramp_s twice")
    if strides.stop_s > strides.period_s:
        raise GaitError(f"it stops at {strides.stop_s:g} s, past the period of {strides.period_s:g} s")
