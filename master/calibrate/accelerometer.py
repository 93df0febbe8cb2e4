"""The accelerometer's nine unknowns from gravity in many attitudes (paper B, eqs. 4 and 17 to 19).

a_o = G (a_s + b) with G upper triangular; θ = [G11 G12 G13 G22 G23 G33 b1 b2 b3], least
Σ (g² - ‖a_o‖²)² over the still intervals' means, by Levenberg–Marquardt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from master.calibrate.uncertainty import covariance, folds, propagate

UNKNOWNS = 9
_UPPER = np.triu_indices(3)
START: Array = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_MIDDLE_OF_UNSIGNED = 32768.0


@dataclass(frozen=True, slots=True)
class AccelerometerFit:
    """Calibrated specific force = gain · (reading + bias), m/s²."""

    gain: Array
    """(3, 3) upper triangular."""
    bias: Array
    """(3,), in the unit of the readings."""
    cov: Array
    """(9, 9), of θ."""
    residuals_m_s2: Array
    """(K,), ‖a_o‖ - g of each still interval."""
    hold_out_m_s2: Array
    """(K,), the same of fits that did not see the interval; NaN where too few were left to fit."""
    cost: float
    """Σ (g² - ‖a_o‖²)², m⁴/s⁸."""

    @property
    def theta(self) -> Array:
        """The nine unknowns."""
        return np.concatenate([self.gain[_UPPER], self.bias])

    @property
    def sigma(self) -> Array:
        """1σ of θ, (9,)."""
        out: Array = np.sqrt(np.diag(self.cov))
        return out

    @property
    def affine(self) -> Array:
        """(3, 4), as a node's file has it."""
        return np.column_stack([self.gain, self.gain @ self.bias])

    @property
    def affine_sigma(self) -> Array:
        """1σ of `affine`, (3, 4)."""
        # the offset is G b: by G_ij it changes by b_j in row i, by b_j by G_ij
        slope = np.zeros((12, UNKNOWNS))
        for n, (i, j) in enumerate(zip(*_UPPER, strict=True)):
            slope[4 * i + j, n] = 1.0
            slope[4 * i + 3, n] = self.bias[j]
        slope[3::4, 6:] = self.gain
        return propagate(self.cov, slope).reshape(3, 4)


def residuals(theta: Array, readings: Array, gravity_m_s2: float) -> Array:
    """g² - ‖G (a_s + b)‖², (K,), of readings (K, 3)."""
    gain, bias = _unpacked(theta)
    out: Array = gravity_m_s2**2 - np.sum(((readings + bias) @ gain.T) ** 2, axis=1)
    return out


def jacobian(theta: Array, readings: Array) -> Array:
    """Derivatives of `residuals` by θ, (K, 9)."""
    gain, bias = _unpacked(theta)
    centred = readings + bias
    force = centred @ gain.T
    rows, columns = _UPPER
    out: Array = -2.0 * np.hstack([force[:, rows] * centred[:, columns], force @ gain])
    return out


def sphere(readings: Array) -> tuple[Array, float]:
    """Centre (3,) and radius of the sphere through readings (K ≥ 4, 3), by linear least squares."""
    design = np.column_stack([2.0 * readings, np.ones(len(readings))])
    solved = np.linalg.lstsq(design, np.sum(readings**2, axis=1), rcond=None)[0]
    centre = solved[:3]
    return centre, float(np.sqrt(max(solved[3] + centre @ centre, 0.0)))


def nominal(readings: Array, gravity_m_s2: float, *, counts: bool) -> Array:
    """θ of a sensor without errors: the paper's start, or for raw counts the middle of their range as zero.

    The scale of counts is that which makes the mean reading (K, 3) gravity.
    """
    if not counts:
        return START
    middle = _MIDDLE_OF_UNSIGNED if readings.min() >= 0.0 else 0.0
    scale = gravity_m_s2 / float(np.mean(np.linalg.norm(readings - middle, axis=1)))
    return np.concatenate([scale * START[:6], np.full(3, -middle)])


def start(readings: Array, gravity_m_s2: float, *, counts: bool) -> Array:
    """θ to fit from: the paper's, or for raw counts that of the sphere through them."""
    if not counts:
        return START
    centre, radius = sphere(readings)
    return np.concatenate([gravity_m_s2 / max(radius, 1e-12) * START[:6], -centre])


def determined(theta: Array, readings: Array, gravity_m_s2: float, error_m_s2: float) -> tuple[float, float]:
    """How far an error in every interval's mean would carry: 1σ of the worst gain and of the worst bias.

    The gain's is a fraction, the bias's in m/s². Infinite where the readings (K, 3) cannot tell.
    """
    slope = jacobian(theta, readings)
    freedom = len(readings) - UNKNOWNS
    variance = (2.0 * gravity_m_s2 * error_m_s2) ** 2
    sigma = np.sqrt(np.diag(covariance(slope, np.zeros(len(slope)), freedom, least_variance=variance)))
    scale = float(np.cbrt(np.abs(np.prod(theta[[0, 3, 5]]))))
    return float(sigma[:6].max() / scale), float(sigma[6:].max() * scale)


def fit_accelerometer(readings: Array, gravity_m_s2: float, first: Array) -> AccelerometerFit:
    """Fit to the mean readings (K ≥ 10, 3) of K still intervals, from θ `first`."""
    theta = solve(readings, gravity_m_s2, first)
    left = residuals(theta, readings, gravity_m_s2)
    gain, bias = _unpacked(theta)
    hold_out = np.full(len(readings), np.nan)
    for out in folds(len(readings)):
        if np.sum(~out) > UNKNOWNS:
            held = solve(readings[~out], gravity_m_s2, theta)
            hold_out[out] = norm_errors(held, readings[out], gravity_m_s2)
    return AccelerometerFit(
        gain=gain,
        bias=bias,
        cov=covariance(jacobian(theta, readings), left, len(readings) - UNKNOWNS),
        residuals_m_s2=norm_errors(theta, readings, gravity_m_s2),
        hold_out_m_s2=hold_out,
        cost=float(left @ left),
    )


def solve(readings: Array, gravity_m_s2: float, first: Array) -> Array:
    """θ that fits the mean readings (K ≥ 9, 3) best, from θ `first`."""
    from scipy.optimize import least_squares

    # counts and m/s² differ by orders of magnitude: solve for what is left to do after the start
    scale = first[0]
    shifted = (readings + first[6:]) * scale

    def slope_at(t: Array, readings: Array, gravity_m_s2: float) -> Array:
        return jacobian(t, readings)

    solved = least_squares(
        residuals,
        np.concatenate([first[:6] / scale, np.zeros(3)]),
        slope_at,
        args=(shifted, gravity_m_s2),
        method="lm",
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    ).x
    return np.concatenate([solved[:6] * scale, first[6:] + solved[6:] / scale])


def norm_errors(theta: Array, readings: Array, gravity_m_s2: float) -> Array:
    """‖G (a_s + b)‖ - g, m/s², (K,), of readings (K, 3)."""
    gain, bias = _unpacked(theta)
    out: Array = np.linalg.norm((readings + bias) @ gain.T, axis=1) - gravity_m_s2
    return out


def _unpacked(theta: Array) -> tuple[Array, Array]:
    gain = np.zeros((3, 3))
    gain[_UPPER] = theta[:6]
    return gain, theta[6:]
