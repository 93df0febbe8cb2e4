"""Which units share a joint, by their accelerations: whether each is on the segment that it is said to be on.

Two neighbours' joint centre moves but once (Kok et al. 2014): p̈1 = p̈2', p̈ = R (a − ω̇ × r − ω × (ω × r)).
For two units that are no neighbours no levers r1, r2 and no heading offset δ make that true. For a given δ
the levers are a linear least-squares problem, so every pair of a suit is tried over all δ at once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from master.calibrate.evidence import CrossCheck, at_most, not_judged
from master.calibrate.joint_residuals import ACCELERATION_M_S2, LEVER_M, Moving
from master.calibrate.oriented import rows_moving

_OFFSETS = 72
_MOST_ROWS = 600
_FEWEST_ROWS = 60
_FLOOR_M_S2 = 0.05
"""Sensors' own noise: below it no pair fits better than another."""
_BETTER = 0.55
"""Another order must lower the sum of log misfits by so much: a right order's is lower by 0.7 to 3."""


@dataclass(frozen=True, slots=True)
class Fits:
    """How well any two of N units fit on one joint."""

    names: tuple[str, ...]
    misfit_m_s2: Array
    """(N, N) RMS of the joint centre's two accelerations against each other; NaN where neither moved."""


def fit_pairs(names: Sequence[str], units: Sequence[Moving]) -> Fits:
    """Every pair of the units."""
    count = len(names)
    misfit = np.full((count, count), np.nan)
    for i, j in itertools.combinations(range(count), 2):
        rows = rows_moving(units[i], units[j])
        if len(rows) >= _FEWEST_ROWS:
            rows = rows[:: max(1, len(rows) // _MOST_ROWS)]
            misfit[i, j] = misfit[j, i] = centre_misfit(units[i].some(rows), units[j].some(rows))
    return Fits(tuple(names), misfit)


def centre_misfit(one: Moving, two: Moving) -> float:
    """RMS (m/s²) of p̈1 − p̈2' at the best δ and levers."""
    # columns: one's levers; two's, level part, the same turned by a quarter, upright part; then the forces
    lever, force = _parts(two.lever), _parts(two.acc[..., None])
    columns = np.concatenate([-one.lever, *lever, one.acc[..., None], *(-f for f in force)], axis=2)
    columns = columns.reshape(-1, columns.shape[-1])
    gram = columns.T @ columns / len(one.acc)
    delta = np.arange(_OFFSETS) * 2.0 * math.pi / _OFFSETS
    # the columns' mixture for every δ: Rz(δ) v = cos δ v_level + sin δ Z × v + v_up
    mix = np.zeros((_OFFSETS, columns.shape[1], 7))
    mix[:, :3, :3] = np.eye(3)
    mix[:, 12, 6] = 1.0
    for part, share in enumerate((np.cos(delta), np.sin(delta), np.ones(_OFFSETS))):
        mix[:, 3 + 3 * part : 6 + 3 * part, 3:6] = share[:, None, None] * np.eye(3)
        mix[:, 13 + part, 6] = share
    small = np.swapaxes(mix, 1, 2) @ gram @ mix
    prior = np.eye(6) * (ACCELERATION_M_S2 / LEVER_M) ** 2 / len(one.acc)
    levers = -np.linalg.solve(small[:, :6, :6] + prior, small[:, :6, 6:])
    ends = np.concatenate([levers, np.ones((_OFFSETS, 1, 1))], axis=1)
    squared = (np.swapaxes(ends, 1, 2) @ small @ ends)[:, 0, 0]
    return math.sqrt(max(0.0, float(squared.min())))


def check_order(fits: Fits, links: Sequence[tuple[int, int]]) -> CrossCheck:
    """Whether the suit fits better with two of its units exchanged; `links` are (parent, child) rows."""
    compared = "neighbours' accelerations against each other"
    rough = np.log(np.maximum(fits.misfit_m_s2, _FLOOR_M_S2))
    if not links or any(math.isnan(rough[link]) for link in links):
        links = [link for link in links if not math.isnan(rough[link])]
        if len(links) < 2:
            return not_judged(compared, "fewer than two joints moved")
    order = list(range(len(fits.names)))
    as_assigned = sum(rough[link] for link in links)
    best, pair = math.inf, (0, 0)
    for a, b in itertools.combinations(order, 2):
        swapped = order.copy()
        swapped[a], swapped[b] = b, a
        there = float(sum(rough[swapped[i], swapped[j]] for i, j in links))
        if there < best:
            best, pair = there, (a, b)
    one, other = (fits.names[i] for i in pair)
    return at_most(
        compared,
        float(as_assigned) - best,
        _BETTER,
        advice=f"{one} and {other} seem to be exchanged: the suit's accelerations fit "
        f"{math.exp(float(as_assigned) - best):.1f} times better with each in the other's place. "
        "Exchange the two units, or their ids in the master's file, and record again",
    )


def _parts(vectors: Array) -> tuple[Array, Array, Array]:
    """Columns (K, 3, C): their level part, Z × them, their upright part."""
    level, turned, upright = np.zeros_like(vectors), np.zeros_like(vectors), np.zeros_like(vectors)
    level[:, :2], upright[:, 2] = vectors[:, :2], vectors[:, 2]
    turned[:, 0], turned[:, 1] = -vectors[:, 1], vectors[:, 0]
    return level, turned, upright
