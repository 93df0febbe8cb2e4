"""Whether something grows: the slope of a series with its confidence, robust against single outliers. Pure.

Series that a restart interrupts are judged as one, each stretch by its own pairs: the slope is the median
over all pairs of points within a stretch (Sen 1968; for several stretches Hirsch, Slack and Smith 1982,
"seasonal Kendall slope"). Its interval follows from the variance of Kendall's S, summed over the stretches
and corrected for ties. Neighbouring points resemble each other (memory does not shrink and grow at random),
which makes an interval look too narrow: the variance is widened by (1 + r) / (1 - r), r being the
correlation of neighbours about the line. By hand, because `scipy.stats.theilslopes` takes neither stretches
nor that correlation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from common.quaternion import Array

FEWEST = 8
"""Points of a stretch; shorter ones say nothing of a slope."""
MOST_RELATED = 0.95


@dataclass(frozen=True, slots=True)
class Slope:
    """Per unit of x, and where it lies with the chosen confidence."""

    value: float
    low: float
    high: float
    points: int


def slope(stretches: Sequence[tuple[Array, Array]], confidence: float = 0.95) -> Slope | None:
    """The common slope of stretches of (x, y), (N,) each; NaN is left out. None where there are too few."""
    kept = [_finite(x, y) for x, y in stretches]
    kept = [(x, y) for x, y in kept if len(x) >= FEWEST]
    if not kept:
        return None
    pairs = np.sort(np.concatenate([_pair_slopes(x, y) for x, y in kept]))
    value = float(np.median(pairs))
    related = _related([(x, y - value * x) for x, y in kept])
    variance = sum(_kendall_variance(y) for _, y in kept) * (1.0 + related) / (1.0 - related)
    reach = NormalDist().inv_cdf(0.5 + confidence / 2.0) * math.sqrt(variance)
    last = len(pairs) - 1
    low = pairs[min(last, max(0, math.floor((len(pairs) - reach) / 2.0) - 1))]
    high = pairs[max(0, min(last, math.ceil((len(pairs) + reach) / 2.0)))]
    return Slope(value, float(low), float(high), sum(len(x) for x, _ in kept))


def in_bins(at_s: Array, values: Array, width_s: float) -> tuple[Array, Array]:
    """Medians of a series (N,) in bins of one width, and the bins' middles; empty bins are left out."""
    good = np.isfinite(values)
    at_s, values = at_s[good], values[good]
    bins = np.floor(at_s / width_s).astype(int)
    numbers = np.unique(bins)
    middles = (numbers + 0.5) * width_s
    return middles, np.array([np.median(values[bins == number]) for number in numbers])


def _finite(x: Array, y: Array) -> tuple[Array, Array]:
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def _pair_slopes(x: Array, y: Array) -> Array:
    i, j = np.triu_indices(len(x), k=1)
    apart = x[j] - x[i]
    slopes: Array = (y[j] - y[i])[apart > 0.0] / apart[apart > 0.0]
    return slopes


def _kendall_variance(y: Array) -> float:
    n = len(y)
    tied = np.unique(y, return_counts=True)[1]
    return float(n * (n - 1) * (2 * n + 5) - (tied * (tied - 1) * (2 * tied + 5)).sum()) / 18.0


def _related(residuals: Sequence[tuple[Array, Array]]) -> float:
    """Correlation of neighbours, 0 to MOST_RELATED; each stretch about its own middle."""
    centred = [y - np.median(y) for _, y in residuals]
    power = sum(float(y @ y) for y in centred)
    if power <= 0.0:
        return 0.0
    return min(MOST_RELATED, max(0.0, sum(float(y[1:] @ y[:-1]) for y in centred) / power))
