"""What a least-squares fit knows of its parameters."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask


def covariance(jacobian: Array, residuals: Array, freedom: int, *, least_variance: float = 0.0) -> Array:
    """Covariance (P, P) of the P parameters of a least-squares fit, s² (JᵀJ)⁻¹.

    J is (M, P) and s² the residuals' sum of squares over the `freedom` left, at least `least_variance`.
    Where few degrees of freedom are left s² itself is not sure: it is enlarged so that 1.96 σ is Student's
    95 % bound. Infinite where the data cannot tell the parameters.
    """
    from scipy.stats import t

    scale = np.linalg.norm(jacobian, axis=0)
    count = jacobian.shape[1]
    if freedom <= 0 or not np.all(scale > 0.0):
        return np.full((count, count), np.inf)
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    if not singular[-1] > 1e-12 * singular[0]:
        return np.full((count, count), np.inf)
    student = float(t.ppf(0.975, freedom)) / 1.96
    variance = max(float(residuals @ residuals) / freedom * student**2, least_variance)
    inverse = rows.T / singular**2 @ rows
    out: Array = variance * inverse / np.outer(scale, scale)
    return out


def propagate(parameters_cov: Array, jacobian: Array) -> Array:
    """1σ (M,) of M quantities whose derivatives by the parameters are `jacobian` (M, P)."""
    out: Array = np.sqrt(np.einsum("mp,pq,mq->m", jacobian, parameters_cov, jacobian))
    return out


def folds(count: int, parts: int = 5) -> list[Mask]:
    """Masks (count,) of what each of the parts holds out: every parts-th, in turn."""
    return [np.arange(count) % parts == part for part in range(parts)]
