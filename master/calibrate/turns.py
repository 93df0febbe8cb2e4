"""Rotations over moving intervals from gyro readings, by RK4, all intervals and derivatives at once.

One RK4 step of q̇ = ½ q ⊗ (0, ω) is q_{k+1} = q_k ⊗ r_k with r_k of the readings alone: so all r_k are
formed together, and each interval's are multiplied pairwise. Quaternions here are four arrays in a row,
(4, 1 + D, N): the value, then its derivatives by D parameters, which go by the product rule.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from master.calibrate.still import Intervals

_BLOCK = 1024


def moving_readings(gyr: Array, moving: Intervals) -> tuple[Array, NDArray[np.intp]]:
    """Pairs of neighbouring readings (N, 2, 3), one of the K intervals after the other, and how many of each.

    An interval from sample a to sample b, both included, has b - a of them.
    """
    steps = [np.stack([gyr[a:b], gyr[a + 1 : b + 1]], axis=1) for a, b in moving]
    return np.concatenate(steps), np.array([len(s) for s in steps], dtype=np.intp)


def turns(
    gain: Array, pairs: Array, counts: NDArray[np.intp], dt_s: float, *, slopes: bool = True
) -> tuple[Array, Array]:
    """Quaternions (K, 4) start-from-end of the K intervals, and derivatives (K, 9, 4) by G row by row.

    Without `slopes` no derivatives, (K, 0, 4), at a tenth of the cost.

    `gain` G is (3, 3): rate = G · reading; `pairs` (N, 2, 3) are bias-free readings, the K intervals'
    `counts` of them one after the other, `dt_s` apart.
    """
    # in blocks that stay in the processor's cache
    blocks = [_steps(gain, pairs[n : n + _BLOCK], dt_s, slopes) for n in range(0, len(pairs), _BLOCK)]
    product = _products(np.concatenate(blocks, axis=2), counts)
    return product[:, 0].T, product[:, 1:].transpose(2, 1, 0)


def _steps(gain: Array, pairs: Array, dt_s: float, slopes: bool) -> Array:
    """The RK4 factors r_k and their derivatives, (4, 1 + D, N)."""
    first, last = (0.5 * _rates(gain, pairs[:, n], slopes) for n in (0, 1))
    middle = 0.5 * (first + last)
    k2 = _product(_one_plus(0.5 * dt_s * first), middle)
    k3 = _product(_one_plus(0.5 * dt_s * k2), middle)
    k4 = _product(_one_plus(dt_s * k3), last)
    return _normalised(_one_plus(dt_s / 6.0 * (first + 2.0 * (k2 + k3) + k4)))


def _rates(gain: Array, readings: Array, slopes: bool) -> Array:
    """(0, G · reading) and its derivatives by G, (4, 1 + D, N)."""
    out = np.zeros((4, 10 if slopes else 1, len(readings)))
    out[1:, 0] = gain @ readings.T
    for i in range(3 if slopes else 0):
        out[1 + i, 1 + 3 * i : 4 + 3 * i] = readings.T
    return out


def _one_plus(q: Array) -> Array:
    out = q.copy()
    out[0, 0] += 1.0
    return out


def _normalised(q: Array) -> Array:
    length = np.linalg.norm(q[:, 0], axis=0)
    value, slope = q[:, :1] / length, q[:, 1:] / length
    return np.concatenate([value, slope - value * np.sum(value * slope, axis=0)], axis=1)


def _products(factors: Array, counts: NDArray[np.intp]) -> Array:
    """Each interval's factors (4, D, N) multiplied in order, (4, D, K)."""
    identity = np.zeros((*factors.shape[:2], 1))
    identity[0, 0] = 1.0
    while counts.max(initial=1) > 1:
        ends = np.cumsum(counts)
        halves = (counts + 1) // 2
        interval = np.repeat(np.arange(len(counts)), halves)
        place = np.arange(halves.sum()) - np.repeat(np.cumsum(halves) - halves, halves)
        left = (ends - counts)[interval] + 2 * place
        # an odd one out at an interval's end is multiplied by the identity, which stands last
        right = np.where(left + 1 < ends[interval], left + 1, factors.shape[2])
        padded = np.concatenate([factors, identity], axis=2)
        factors, counts = _product(padded[..., left], padded[..., right]), halves
    return factors


def _product(p: Array, q: Array) -> Array:
    """Product p ⊗ q of values and derivatives, (4, 1 + D, N)."""
    out = _hamilton(p[:, :1], q)
    out[:, 1:] += _hamilton(p[:, 1:], q[:, :1])
    return out


def _hamilton(p: Array, q: Array) -> Array:
    a, b, c, d = p
    e, f, g, h = q
    out = np.empty((4, *np.broadcast_shapes(a.shape, e.shape)))
    out[0] = a * e - b * f - c * g - d * h
    out[1] = a * f + b * e + c * h - d * g
    out[2] = a * g - b * h + c * e + d * f
    out[3] = a * h + b * g - c * f + d * e
    return out
