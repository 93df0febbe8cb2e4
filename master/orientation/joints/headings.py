"""How far each node's heading is off and how fast it drifts, and how sure that is: one Kalman filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

Indices = NDArray[np.intp]


class Headings:
    """θ (N,), rad, about the vertical, and its drift ω (N,), rad/s: what the gyros' biases leave.

    A Kalman filter of 2 N states: θ̇ = ω + noise, ω̇ = noise. All measurements of one time are taken together.
    With A = Σ hᵀ h / r over their rows h and variances r, all of them on θ, the filter's covariance update in
    information form, (P⁻¹ + A)⁻¹, becomes P - P (I + A P)⁻¹ A P, in which only the θ of P is inverted.
    """

    def __init__(self, variance: Array, drift_variance: Array) -> None:
        """Starts at 0 with variances (N,), rad² and (rad/s)²."""
        self.theta_rad: Array = np.zeros(len(variance))
        """(N,) estimate."""
        self.drift_rad_s: Array = np.zeros(len(variance))
        """(N,) estimate of its drift."""
        self.covariance: Array = np.diag(np.concatenate([variance, drift_variance]))
        """(2 N, 2 N) of θ, then ω."""

    @property
    def variance(self) -> Array:
        """(N,) of θ, rad²."""
        return np.diagonal(self.covariance)[: len(self.theta_rad)]

    def variance_between(self, one: Indices, other: Indices) -> Array:
        """Variance (M,) of the differences in θ of pairs (M,) of nodes, rad²."""
        p = self.covariance
        out: Array = p[one, one] + p[other, other] - 2.0 * p[one, other]
        return out

    def drift(self, dt_s: float, walk: float, drift_walk: float) -> None:
        """Let time pass: θ goes on at ω; random walks add variance, rad²/s and (rad/s)²/s."""
        n, p = len(self.theta_rad), self.covariance
        self.theta_rad = self.theta_rad + dt_s * self.drift_rad_s
        # F P Fᵀ of F = [[1, dt], [0, 1]], in place: first the rows, then the columns
        p[:n] += dt_s * p[n:]
        p[:, :n] += dt_s * p[:, n:]
        p.flat[:: 2 * n + 1] += np.repeat([walk * dt_s, drift_walk * dt_s], n)

    def set(self, nodes: Mask, theta_rad: Array, variance: float) -> None:
        """Take θ (N,) of some nodes, mask (N,), as known with that variance, rad², whatever was believed.

        Their drift stays, and what is known of it.
        """
        rows = np.flatnonzero(nodes)
        self.theta_rad = np.where(nodes, theta_rad, self.theta_rad)
        self.covariance[rows] = 0.0
        self.covariance[:, rows] = 0.0
        self.covariance[rows, rows] = variance

    def restart_drift(self, nodes: Mask, variance: float) -> None:
        """Forget the drift of some nodes, mask (N,): 0 with that variance, (rad/s)²."""
        rows = np.flatnonzero(nodes) + len(nodes)
        self.drift_rad_s = np.where(nodes, 0.0, self.drift_rad_s)
        self.covariance[rows] = 0.0
        self.covariance[:, rows] = 0.0
        self.covariance[rows, rows] = variance

    def correct(self, information: Array, gain: Array) -> None:
        """Take all measurements of one time: A (N, N), 1/rad², and Σ hᵀ ν / r (N,), 1/rad.

        ν is what was measured minus what the estimate foretells.
        """
        n, p = len(self.theta_rad), self.covariance
        of_theta = p[:, :n]
        share = np.linalg.solve(np.eye(n) + information @ p[:n, :n], information)
        after = p - of_theta @ share @ of_theta.T
        self.covariance = 0.5 * (after + after.T)
        step = self.covariance[:, :n] @ gain
        self.theta_rad = self.theta_rad + step[:n]
        self.drift_rad_s = self.drift_rad_s + step[n:]
