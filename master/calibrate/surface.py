"""The least robust sum of distances between readings and an ellipsoid, by damped Gauss–Newton.

The ellipsoid is ‖S (m - c)‖ = 1, S (3, 3) symmetric and positive definite. A reading's distance from it is
taken to first order (Sampson): (r - 1) / ‖∇r‖ with r = ‖S (m - c)‖, exact for a sphere. The loss is Tukey's
biweight, which forgets what lies further off than 4.685 standard deviations (Huber and Ronchetti, "Robust
Statistics", 2009); their scale is taken from the median, so that outliers do not widen it.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array

Parameters = tuple[Array, Array]
"""S (3, 3) and c (3,)."""
_ROWS, _COLUMNS = np.triu_indices(3)
_BESIDE = _ROWS != _COLUMNS
"""Of the upper triangle, beside the diagonal."""
_STEPS = 60
_TUKEY = 4.685
_SETTLED = 1e-10
_LEAST_SCALE = 1e-9
"""Of readings scaled to the unit sphere: without noise all distances are rounding."""
_FIRST_DAMPING, _MOST_DAMPING = 1e-4, 1e8


class RunsAwayError(ValueError):
    """The least distances are those of no ellipsoid."""


def distances(parameters: Parameters, m: Array) -> Array:
    """Distances (K,) of readings (K, 3) from the surface, in their unit; positive outside."""
    shape, centre = parameters
    # a row an axis: sums over rows take a fifth of the time of sums over three columns
    mapped = shape @ (m - centre).T
    r, q = _lengths(mapped), np.maximum(_lengths(shape @ mapped), 1e-300)
    out: Array = (r - 1.0) * r / q
    return out


def weights(left: Array) -> Array:
    """Tukey's weights (K,), 0 to 1, of distances (K,) whose scale is their own."""
    return _weights(left, _scale(left))


def slopes_of_norm(parameters: Parameters, m: Array) -> Array:
    """Derivatives (K, 9) of ‖S (m - c)‖ by S's upper triangle and c."""
    shape, centre = parameters
    x = (m - centre).T
    mapped = shape @ x
    return _by_norm(shape, x, mapped / _lengths(mapped)).T


def slopes(parameters: Parameters, m: Array) -> Array:
    """Derivatives (K, 9) of `distances` by S's upper triangle and c."""
    shape, centre = parameters
    x = (m - centre).T
    mapped = shape @ x
    r, p = _lengths(mapped), shape @ mapped
    q = np.maximum(_lengths(p), 1e-300)
    way = p / q
    # d = (r² - r) / q with q = ‖S S x‖
    by_r = _by_norm(shape, x, mapped / r)
    by_q = np.vstack([_by_symmetric(way, mapped) + _by_symmetric(shape @ way, x), -shape @ shape @ way])
    by_r *= (2.0 * r - 1.0) / q
    by_q *= (r**2 - r) / q**2
    by_r -= by_q
    return by_r.T


def refined(first: Parameters, m: Array) -> Parameters:
    """Descend from S and c to the least loss over readings (K, 3) about the unit sphere's size.

    Raises RunsAwayError where there is no minimum.
    """
    found = first
    scale = _scale(distances(found, m))
    for _ in range(3):
        found = _descended(found, m, scale)
        before, scale = scale, _scale(distances(found, m))
        if abs(scale - before) < 0.01 * before:
            break
    return found


def _descended(found: Parameters, m: Array, scale: float) -> Parameters:
    left = distances(found, m)
    loss, damping = _loss(left, scale), _FIRST_DAMPING
    for _ in range(_STEPS):
        weight, slope = _weights(left, scale), slopes(found, m)
        normal, gradient = (slope.T * weight) @ slope, slope.T @ (weight * left)
        while damping < _MOST_DAMPING:
            damped = normal + np.diag(damping * np.diag(normal) + 1e-300)
            step = np.linalg.solve(damped, -gradient).astype(np.float64)
            trial = _stepped(found, step)
            if np.linalg.eigvalsh(trial[0])[0] > 0.0:
                there = distances(trial, m)
                if _loss(there, scale) <= loss:
                    break
            damping *= 10.0
        else:
            return found
        found, left, loss, damping = trial, there, _loss(there, scale), max(0.1 * damping, 1e-12)
        if np.abs(step).max() < _SETTLED:
            return found
    values = np.linalg.eigvalsh(found[0])
    if not values[0] > 1e-3 * values[-1]:
        raise RunsAwayError("the distances are least without an ellipsoid")
    return found


def _stepped(found: Parameters, step: Array) -> Parameters:
    change = np.zeros((3, 3))
    change[_ROWS, _COLUMNS] = step[:6]
    change += np.triu(change, 1).T
    return found[0] + change, found[1] + step[6:]


def _lengths(columns: Array) -> Array:
    """Length (K,) of each column of (3, K)."""
    out: Array = np.sqrt(np.einsum("ik,ik->k", columns, columns))
    return out


def _by_norm(shape: Array, x: Array, unit: Array) -> Array:
    """Derivatives (9, K) of ‖S x‖, which points along `unit` (3, K), by S's upper triangle and by c."""
    return np.vstack([_by_symmetric(unit, x), -shape @ unit])


def _by_symmetric(a: Array, b: Array) -> Array:
    """Derivatives (6, K) of a · (S b) by the upper triangle of a symmetric S; a and b (3, K)."""
    out: Array = a[_ROWS] * b[_COLUMNS]
    out[_BESIDE] += a[_COLUMNS[_BESIDE]] * b[_ROWS[_BESIDE]]
    return out


def _scale(left: Array) -> float:
    return max(1.4826 * float(np.median(np.abs(left))), _LEAST_SCALE)


def _weights(left: Array, scale: float) -> Array:
    out: Array = np.maximum(1.0 - (left / (_TUKEY * scale)) ** 2, 0.0) ** 2
    return out


def _loss(left: Array, scale: float) -> float:
    return float(np.sum(1.0 - np.maximum(1.0 - (left / (_TUKEY * scale)) ** 2, 0.0) ** 3))
