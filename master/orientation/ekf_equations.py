"""The equations of the extended Kalman filter (`ekf.py`), for n nodes at once.

Error states, (n, 6): a small rotation φ in the world frame (east, north, up), then the gyro's bias error.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array, from_rotation_vector, multiply

_UP = 2
_BIAS = slice(3, 6)
_IDENTITY_6 = np.eye(6)


def propagate(q: Array, rate_rad_s: Array, dt_s: float) -> Array:
    """Turn orientations (n, 4) by the sensors' rates (n, 3) over `dt_s`, exact for a constant rate."""
    return multiply(q, from_rotation_vector(rate_rad_s * dt_s))


def turn_by(phi_rad: Array, q: Array) -> Array:
    """Orientations (n, 4) after a small turn φ (n, 3) in the world, to its second order, at unit length."""
    step = np.empty_like(q)
    step[:, 0] = 1.0
    np.multiply(phi_rad, 0.5, out=step[:, 1:])
    q = multiply(step, q)
    q /= np.sqrt(np.einsum("ni,ni->n", q, q))[:, None]
    return q


def transition(matrix: Array, dt_s: float) -> Array:
    """Jacobian (n, 6, 6) of one prediction's (φ, bias error), from world-from-sensor matrices (n, 3, 3).

    A bias larger than thought turns the estimate too far: dφ/dt = −R δb (Eq. 39 in error states).
    """
    out = np.zeros((len(matrix), 6, 6))
    out[:] = _IDENTITY_6
    np.multiply(matrix, -dt_s, out=out[:, :3, _BIAS])
    return out


def predict(covariance: Array, matrix: Array, dt_s: float, turn_noise: float, bias_noise: float) -> Array:
    """Covariances (n, 6, 6) after `dt_s`: F P Fᵀ + Q, Q from the densities' squares (rad²/s, rad²/s³)."""
    step = transition(matrix, dt_s)
    out: Array = step @ covariance @ step.transpose(0, 2, 1)
    out += np.diag(np.repeat([turn_noise * dt_s, bias_noise * dt_s], 3))
    return out


def scalar_update(correction: Array, covariance: Array, index: int, residual: Array, variance: Array) -> None:
    """Take a measurement of one error state, in place.

    Corrections (n, 6) and covariances (n, 6, 6) as they are after the updates before it; residual and
    variance (n,), an infinite variance takes nothing. One after the other, measurements of uncorrelated
    noise give what Eq. 40 gives for all at once, without a matrix to invert.
    """
    row = covariance[:, index].copy()
    gain = row / (row[:, index] + variance)[:, None]
    correction += gain * (residual - correction[:, index])[:, None]
    covariance -= gain[:, :, None] * row[:, None, :]


def heading_update(correction: Array, covariance: Array, residual_rad: Array, variance: Array) -> Array:
    """The same for the heading, but inclination and bias keep what they are (their gain is 0).

    Returns the turns taken (n,). The covariance is that of this gain: (I − KH) P (I − KH)ᵀ + K R Kᵀ.
    """
    gain = covariance[:, _UP, _UP] / (covariance[:, _UP, _UP] + variance)
    off = residual_rad - correction[:, _UP]
    turn: Array = gain * (off - math.tau * np.rint(off / math.tau))
    correction[:, _UP] += turn
    left = 1.0 - gain
    own = covariance[:, _UP, _UP] * left
    covariance[:, _UP] *= left[:, None]
    covariance[:, :, _UP] *= left[:, None]
    covariance[:, _UP, _UP] = own
    return turn
