"""The gyroscope's bias and nine-unknown matrix (paper B, 2.2.1; Tedaldi et al. 2014).

ω = G (ω_s + b). b: minus the mean over still intervals. G: each moving interval is integrated (RK4) and
gravity as it was before must arrive as it is after, least Σ ‖u_after - u_predicted‖², by
Levenberg–Marquardt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array, conjugate, cross, rotate
from master.calibrate.turns import turns
from master.calibrate.uncertainty import covariance, folds, propagate

UNKNOWNS = 9
_MOST_EVALUATIONS = 60
"""Sound moves take about ten; what takes more does not fit, and shows by its errors."""


@dataclass(frozen=True, slots=True)
class Moves:
    """K moving intervals, one after the other."""

    pairs: Array
    """(N, 2, 3) neighbouring readings, bias taken off."""
    counts: NDArray[np.intp]
    """(K,) how many pairs each interval has."""
    before: Array
    """(K, 3) unit vector of calibrated gravity before the move, sensor frame."""
    after: Array
    """(K, 3) the same after it."""
    dt_s: float

    def of(self, chosen: NDArray[np.bool_]) -> Moves:
        """Those of the intervals."""
        pairs = self.pairs[np.repeat(chosen, self.counts)]
        return Moves(pairs, self.counts[chosen], self.before[chosen], self.after[chosen], self.dt_s)


@dataclass(frozen=True, slots=True)
class GyroscopeFit:
    """Calibrated rate = gain · (reading + bias), rad/s."""

    gain: Array
    """(3, 3)."""
    bias: Array
    """(3,), in the unit of the readings."""
    gain_cov: Array
    """(9, 9), of G row by row."""
    bias_sigma: Array
    """(3,)."""
    errors_rad: Array
    """(K,), angle between gravity as turned by the gyro and as measured, a moving interval each."""
    hold_out_rad: Array
    """(K,), the same of fits that did not see the interval; NaN where too few were left to fit."""
    cost: float
    """Σ ‖u_after - u_predicted‖²."""

    @property
    def sigma(self) -> Array:
        """1σ of G, (3, 3)."""
        out: Array = np.sqrt(np.diag(self.gain_cov)).reshape(3, 3)
        return out

    @property
    def affine(self) -> Array:
        """(3, 4), as a node's file has it."""
        return np.column_stack([self.gain, self.gain @ self.bias])

    @property
    def affine_sigma(self) -> Array:
        """1σ of `affine`, (3, 4)."""
        slope: Array = np.kron(np.eye(3), self.bias).astype(np.float64)
        offset = np.sqrt(propagate(self.gain_cov, slope) ** 2 + self.gain**2 @ self.bias_sigma**2)
        return np.column_stack([self.sigma, offset])


def predicted(gain: Array, moves: Moves) -> tuple[Array, Array]:
    """Gravity after each move as the gyro turns it, (K, 3), and its derivatives by G, (K, 3, 9)."""
    q, slope = turns(gain, moves.pairs, moves.counts, moves.dt_s)
    back = conjugate(q)
    arrived = rotate(back, moves.before)
    # dq = q ⊗ (0, δ/2) turns what arrives by -δ: u changes by u × δ
    delta = 2.0 * _left_divided(q, slope)
    return arrived, cross(arrived[:, None], delta).transpose(0, 2, 1)


def gravity_errors(gain: Array, moves: Moves) -> Array:
    """Angle between gravity as turned by the gyro and as measured after each move, rad, (K,)."""
    q, _ = turns(gain, moves.pairs, moves.counts, moves.dt_s, slopes=False)
    arrived = rotate(conjugate(q), moves.before)
    out: Array = np.arctan2(
        np.linalg.norm(cross(arrived, moves.after), axis=1), np.sum(arrived * moves.after, axis=1)
    )
    return out


def nominal_scale(moves: Moves) -> float:
    """The unit of the readings, rad/s each, by trying all that converters have on the shorter moves."""
    # the fastest reading of a session made by hand, 0.5 to 100 rad/s; 5 % apart, near enough to start from
    fastest = float(np.max(np.linalg.norm(moves.pairs, axis=-1)))
    short = moves.of(moves.counts <= np.quantile(moves.counts, 0.3))
    coarse = _best(np.exp(np.arange(np.log(0.5), np.log(100.0), 0.05)) / fastest, short)
    return _best(coarse * np.linspace(0.95, 1.05, 11), moves)


def _best(scales: Array, moves: Moves) -> float:
    costs = [float(np.mean(gravity_errors(scale * np.eye(3), moves))) for scale in scales]
    return float(scales[int(np.argmin(costs))])


def fit_gyroscope(
    moves: Moves,
    still_means: Array,
    still_sigma: Array,
    start: float = 1.0,
    progress: Callable[[float], None] = lambda share: None,
) -> GyroscopeFit:
    """Fit to the moves (K ≥ 5), for the still intervals' mean readings (S, 3) as they came.

    `still_sigma` (3,) is the least 1σ of the bias, from the readings' noise. `start` is the unit of a
    reading in rad/s. `progress` hears what share is done.
    """
    gain, left, slope = _solve(moves, start * np.eye(3))
    progress(0.4)
    hold_out = np.full(len(moves.counts), np.nan)
    parts = folds(len(moves.counts))
    for n, out in enumerate(parts, start=1):
        if 2 * np.sum(~out) > UNKNOWNS and out.any():
            held, _, _ = _solve(moves.of(~out), gain)
            hold_out[out] = gravity_errors(held, moves.of(out))
        progress(0.4 + 0.6 * n / len(parts))
    spread = np.std(still_means, axis=0, ddof=1) / np.sqrt(len(still_means))
    return GyroscopeFit(
        gain=gain,
        bias=-np.mean(still_means, axis=0),
        # a unit vector's three components hold two figures
        gain_cov=covariance(slope, left, 2 * len(moves.counts) - UNKNOWNS),
        bias_sigma=np.maximum(spread, still_sigma),
        errors_rad=gravity_errors(gain, moves),
        hold_out_rad=hold_out,
        cost=float(left @ left),
    )


def _solve(moves: Moves, start: Array) -> tuple[Array, Array, Array]:
    """G (3, 3), the residuals (3 K,) and their derivatives (3 K, 9) there."""
    from scipy.optimize import least_squares

    scale = float(np.cbrt(np.abs(np.linalg.det(start))))
    last: list[tuple[bytes, Array, Array]] = []

    def at(g: Array) -> tuple[Array, Array]:
        # the solver asks for residuals and derivatives in turn, at the same place
        key = g.tobytes()
        if not last or last[0][0] != key:
            arrived, slope = predicted(scale * g.reshape(3, 3), moves)
            last[:] = [(key, (arrived - moves.after).ravel(), scale * slope.reshape(-1, UNKNOWNS))]
        return last[0][1], last[0][2]

    def left_at(g: Array) -> Array:
        return at(g)[0]

    def slope_at(g: Array) -> Array:
        return at(g)[1]

    solved = least_squares(
        left_at,
        start.ravel() / scale,
        slope_at,
        method="lm",
        xtol=1e-6,
        ftol=1e-8,
        gtol=1e-10,
        max_nfev=_MOST_EVALUATIONS,
    ).x
    left, slope = at(solved)
    return scale * solved.reshape(3, 3), left, slope / scale


def _left_divided(q: Array, slope: Array) -> Array:
    """Vector part of q* ⊗ q', (K, D, 3), for q (K, 4) and q' (K, D, 4)."""
    w, r = q[:, None, :1], q[:, None, 1:]
    out: Array = w * slope[..., 1:] - slope[..., :1] * r - cross(r, slope[..., 1:])
    return out
