"""Where a recording holds still, by the norm of the gyroscope (paper B, 2.2.1; Tedaldi et al. 2014)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

Intervals = NDArray[np.intp]
"""(K, 2): first sample and one past the last."""

WINDOW_S = 0.5
"""Over which the rate is averaged: short beside a still interval, long beside a heartbeat in a hand."""
THRESHOLDS = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)
"""Multiples of the stillest rate that may bound what is still; the best of them is taken."""
_STILLEST = 0.05
_DISTINCT_COS = float(np.cos(np.radians(10.0)))


def motion_level(gyr: Array, rate_hz: float) -> Array:
    """Root mean square of the rate without its bias over a sliding window, (T,), in the unit of `gyr`.

    Infinite where a sample (T, 3) within the window is missing.
    """
    width = max(3, round(WINDOW_S * rate_hz) | 1)
    missing = np.any(np.isnan(gyr), axis=1)
    known = np.where(missing[:, None], 0.0, gyr)
    mean, square = _sliding(known, width), _sliding(known**2, width)
    spread = np.sum(np.maximum(square - mean**2, 0.0), axis=1)
    gaps = _sliding(missing[:, None].astype(float), width)[:, 0] > 0.5 / width
    spread[gaps] = np.inf
    # the bias from the windows that vary least, then the norm about it: a slow even turn is motion as well
    stillest = spread <= np.quantile(spread, _STILLEST)
    bias = np.median(mean[stillest], axis=0)
    level: Array = np.sqrt(np.maximum(np.sum(square, axis=1) - 2.0 * mean @ bias + bias @ bias, 0.0))
    level[gaps] = np.inf
    return level


def variation(samples: Array, rate_hz: float) -> Array:
    """Standard deviation of the readings (T, 3) within a sliding window, (T,), infinite beside gaps."""
    width = max(3, round(WINDOW_S * rate_hz) | 1)
    missing = np.any(np.isnan(samples), axis=1)
    known = np.where(missing[:, None], 0.0, samples - np.nanmean(samples, axis=0))
    mean, square = _sliding(known, width), _sliding(known**2, width)
    out: Array = np.sqrt(np.sum(np.maximum(square - mean**2, 0.0), axis=1))
    out[_sliding(missing[:, None].astype(float), width)[:, 0] > 0.5 / width] = np.inf
    return out


def stillest_level(level: Array, floor: float) -> float:
    """The rate of a node at rest: its noise, or a hand's tremor; at least `floor`."""
    return max(float(np.quantile(level, _STILLEST)), floor)


def still_intervals(level: Array, limit: float, rate_hz: float, shortest_s: float) -> Intervals:
    """Stretches (K, 2) of at least `shortest_s` throughout which the level (T,) is below the limit.

    Both ends are cut by half a window, within which motion hides in the average.
    """
    found = runs(level < limit)
    # a rest is longer by a window than what lies below the limit
    long_enough = found[:, 1] - found[:, 0] >= (shortest_s - WINDOW_S) * rate_hz
    half = round(0.5 * WINDOW_S * rate_hz)
    cut = found[long_enough] + np.array([half, -half])
    out: Intervals = cut[cut[:, 1] - cut[:, 0] >= 2]
    return out


def runs(flags: Mask) -> Intervals:
    """The stretches (K, 2) in which flags (T,) are true."""
    return np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))).reshape(-1, 2)


def interval_means(samples: Array, intervals: Intervals) -> Array:
    """Mean of the samples (T, 3) over each interval, (K, 3); missing ones left out."""
    return np.array([np.nanmean(samples[a:b], axis=0) for a, b in intervals]).reshape(-1, 3)


def distinct_attitudes(directions: Array) -> int:
    """How many of the unit vectors (K, 3) are more than 10° from all those counted before."""
    kept: list[Array] = []
    for d in directions:
        if all(d @ k < _DISTINCT_COS for k in kept):
            kept.append(d)
    return len(kept)


def _sliding(values: Array, width: int) -> Array:
    """Centred mean over `width` (odd) samples of (T, C); at the ends over those there are."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    place = np.arange(len(values))
    first = np.maximum(place - width // 2, 0)
    last = np.minimum(place + width // 2 + 1, len(values))
    out: Array = (total[last] - total[first]) / (last - first)[:, None]
    return out
