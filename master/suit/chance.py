"""How long one axis of a sensor must repeat until chance is ruled out, from that axis's own noise. Pure.

A reading is truth plus noise, rounded to counts. Of white or low-passed Gaussian noise of σ counts, whatever
the truth between two counts, the next reading is the same with a probability of at most (Anderson 1955)

    P(σ) = erf(1 / (2 √2 σ))        and n more in a row with Pⁿ.

σ comes from how often two neighbours differ by two counts or more, s: it is the least σ that gives so many,
of whatever truth between two counts, so it is too small rather than too large. How often an axis repeats
would not do: between two counts an axis of hardly any noise alternates, and in the next posture it stands.
"""

from __future__ import annotations

import math
from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

_below = np.vectorize(NormalDist().cdf, otypes=[np.float64])
"""Share of a normal distribution below. scipy's would cost the master 26 MB, for a table made once."""
_YEAR_S = 365.25 * 86400.0
_KNOWN_SAMPLES = 200.0
"""Neighbours seen at rest before a noise is known: a second at 200 Hz."""
_KEPT_SAMPLES = 3000.0
"""How many the estimate goes back."""
_SURE = 3.0
"""Standard deviations by which s is taken lower than it was seen."""
NEVER = 2**62


@cache
def _most_far() -> tuple[Array, Array]:
    """σ in counts, and the largest share of neighbours that differ by two counts, over all truths."""
    sigmas = np.concatenate([[0.0], np.geomspace(0.12, 4.0, 120)])
    edges = np.arange(-20, 22) - 0.5
    shares = [0.0]
    for sigma in sigmas[1:]:
        worst = 0.0
        for truth in np.linspace(0.0, 0.5, 11):
            level = np.diff(_below((edges - truth) / sigma))
            near = (level**2).sum() + 2.0 * (level[1:] * level[:-1]).sum()
            worst = max(worst, 1.0 - float(near))
        shares.append(worst)
    return sigmas, np.maximum.accumulate(shares)


def longest_repeat(sigma_counts: Array, starts_a_year: float) -> Array:
    """Samples that repeat by chance less than once a year, of so many that could begin it; inf at σ = 0."""
    stays = np.zeros_like(sigma_counts)
    known = sigma_counts > 0.0
    stays[known] = [math.erf(1.0 / (2.0 * math.sqrt(2.0) * s)) for s in sigma_counts[known]]
    with np.errstate(divide="ignore"):
        samples = math.log(starts_a_year) / -np.log(stays)
    return np.where(known, np.ceil(samples), np.inf)


class RepeatChance:
    """The noise of N nodes' accelerometers and gyros at rest, (N, 6), and how long each axis may repeat."""

    def __init__(self, count: int, rate_hz: float, scale: Array, longest_samples: float) -> None:
        """`scale` (6,) or (N, 6): SI per count. An axis that needs over `longest_samples` is not judged."""
        self._two_counts = 1.5 * scale
        self._starts_a_year = 6.0 * count * rate_hz * _YEAR_S
        self._longest = longest_samples
        self._seen = np.zeros((count, 6))
        self._far = np.zeros((count, 6))
        self.samples: NDArray[np.int64] = np.full((count, 6), NEVER)
        """(N, 6) how often an axis repeats before it is stuck, where its sensor is quiet."""
        self.all_three: NDArray[np.int64] = np.zeros((count, 2), np.int64)
        """(N, 2) the same for all three axes of a sensor at once; 0 for a gyro that was never quiet, and for
        accelerometers, whose noise is counts in every unit there is."""
        _most_far()  # 23 ms once: here, not in the loop's first quiet second

    def learn(self, block: Array, quiet: Mask) -> None:
        """Neighbouring readings (T, N, 6) in SI, of axes (N, 6) that rest and do not stand."""
        far = (np.abs(np.diff(block, axis=0)) > self._two_counts).sum(axis=0)
        forget = 1.0 - (len(block) - 1) / _KEPT_SAMPLES
        self._seen = np.where(quiet, forget * self._seen + len(block) - 1, self._seen)
        self._far = np.where(quiet, forget * self._far + far, self._far)

    def conclude(self) -> None:
        """Bring `samples` up to date; seldom, for it costs more than `learn`."""
        samples = longest_repeat(self.sigma_counts(), self._starts_a_year)
        self.samples = _whole(np.where(samples <= self._longest, samples, np.inf))
        # the logarithms of the three chances add up, and a limit is inverse to its axis's logarithm
        with np.errstate(divide="ignore"):
            three = 1.0 / (1.0 / samples).reshape(-1, 2, 3).sum(axis=2)
        quiet = self._seen.reshape(-1, 2, 3).min(axis=2) > 0.0
        quiet[:, 0] = False
        self.all_three = np.where(quiet, _whole(three), 0)

    def sigma_counts(self) -> Array:
        """(N, 6) the least noise that what was seen allows; 0 where it is not known."""
        seen = np.maximum(self._seen, 1.0)
        share = self._far / seen
        share = share - _SURE * np.sqrt(share / seen)
        known = (self._seen >= _KNOWN_SAMPLES) & (share > 0.0)
        out: Array = np.zeros_like(share)
        sigmas, shares = _most_far()
        out[known] = np.interp(share[known], shares, sigmas)
        return out


def _whole(samples: Array) -> NDArray[np.int64]:
    return np.where(np.isfinite(samples), np.ceil(samples), NEVER).astype(np.int64)
