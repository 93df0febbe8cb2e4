"""Whether all parts of a recording tell the same of a joint, and what that leaves of the answer's certainty.

Each block of time has its own gradient s_b and normal matrix N_b at the answer. From them follow, to first
order and without another descent, the answer of any part of the recording, x = −(Σ N_b)⁻¹ Σ s_b, and the
answer's covariance with residuals that hang together within a block, N⁻¹ (Σ s_b s_bᵀ) N⁻¹ (White 1980; Liang
and Zeger 1986). A unit that slipped tells one thing before and another after.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from master.calibrate.joint_residuals import JointProblem, Unknowns

_BLOCKS = 12
_FEWEST = 2
"""Blocks in the smaller part of a split."""
_KNOWN_RAD = math.radians(8.0)
"""A part that does not tell its answer as well as that is not compared."""
_CHANCE = 2.0
"""Standard deviations by which two parts differ by chance."""


@dataclass(frozen=True, slots=True)
class Steadiness:
    """One standard deviation by the blocks' scatter, and how far parts of the recording are apart beyond."""

    offset_sigma_rad: float
    axis_sigma_rad: tuple[float, float]
    """π each of a ball joint."""
    offset_change_rad: float
    axis_change_rad: tuple[float, float]
    change_share: float
    """After which share of the moving samples the offset or an axis changed most."""


def steadiness(problem: JointProblem, best: Unknowns) -> Steadiness:
    """Of a joint's answer over the samples of the problem, in the order of time."""
    gradient, normal, prior = problem.by_sample(best)
    edges = np.linspace(0, len(gradient), _BLOCKS + 1).round().astype(int)
    scores, normals = (
        np.array([part[a:b].sum(axis=0) for a, b in itertools.pairwise(edges.tolist())])
        for part in (gradient, normal)
    )
    at = 0 if best.axes is None else 4
    covariance = _scatter(scores, normals, prior)[1]
    changes = np.zeros((_BLOCKS, 3))
    for split in range(_FEWEST, _BLOCKS - _FEWEST + 1):
        (x1, c1), (x2, c2) = (
            _scatter(scores[part], normals[part], 0.5 * prior)
            for part in (slice(None, split), slice(split, None))
        )
        apart, together = x2 - x1, c1 + c2
        places = [slice(at, at + 1), *((slice(0, 2), slice(2, 4)) if at else ())]
        for k, place in enumerate(places):
            sigma = worst_sigma(together[place, place])
            if sigma < _KNOWN_RAD:
                changes[split, k] = max(0.0, float(np.linalg.norm(apart[place])) - _CHANCE * sigma)
    worst = np.minimum(changes.max(axis=0), math.pi)
    return Steadiness(
        worst_sigma(covariance[at : at + 1, at : at + 1]),
        (worst_sigma(covariance[:2, :2]), worst_sigma(covariance[2:4, 2:4])) if at else (math.pi, math.pi),
        float(worst[0]),
        (float(worst[1]), float(worst[2])),
        float(np.argmax(changes.max(axis=1))) / _BLOCKS,
    )


def _scatter(scores: Array, normals: Array, prior: Array) -> tuple[Array, Array]:
    """The part's own answer (P,), from the whole one, and its covariance by its blocks' scatter about it."""
    inverse = np.linalg.pinv(normals.sum(axis=0) + prior, rcond=1e-12).astype(np.float64)
    own = -inverse @ scores.sum(axis=0)
    left = scores + normals @ own
    count = len(scores)
    return own, inverse @ (left.T @ left) @ inverse * count / max(1, count - 1)


def worst_sigma(covariance: Array) -> float:
    """Standard deviation along the least known direction, at most π."""
    return min(math.pi, math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance)[-1]))))
