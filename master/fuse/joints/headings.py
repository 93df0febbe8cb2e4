"""How far each node's heading is off, and how sure that is: a Kalman filter with one state a node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.messages import Mask
from common.quaternion import Array

Indices = NDArray[np.intp]


class Headings:
    """θ (N,), rad, about the vertical, with its covariance P (N, N), rad².

    A Kalman filter of a random walk; all measurements of one time are taken together (information form),
    P⁺ = (P⁻¹ + A)⁻¹ with A = Σ hᵀ h / r over their rows h and variances r.
    """

    def __init__(self, variance: Array) -> None:
        """Starts at 0 with variances (N,)."""
        self.theta_rad = np.zeros(len(variance))
        """(N,) estimate."""
        self.covariance: Array = np.diag(variance)
        """(N, N) its covariance, rad²."""

    @property
    def variance(self) -> Array:
        """(N,) rad²."""
        return np.diagonal(self.covariance)

    def variance_between(self, one: Indices, other: Indices) -> Array:
        """Variance (M,) of the differences of pairs (M,) of nodes, rad²."""
        p = self.covariance
        out: Array = p[one, one] + p[other, other] - 2.0 * p[one, other]
        return out

    def drift(self, variance: Array) -> None:
        """Time passes: add variances (N,), rad²."""
        self.covariance.flat[:: len(variance) + 1] += variance

    def set(self, nodes: Mask, theta_rad: Array, variance: Array) -> None:
        """Start some nodes, mask (N,), anew at θ (N,) with variances (N,), whatever was believed of them."""
        self.theta_rad[nodes] = theta_rad[nodes]
        self.covariance[nodes] = 0.0
        self.covariance[:, nodes] = 0.0
        self.covariance[nodes, nodes] = variance[nodes]

    def correct(self, information: Array, gain: Array) -> None:
        """Take all measurements of one time: A (N, N), 1/rad², and Σ hᵀ ν / r (N,), 1/rad.

        ν is what was measured minus what the estimate foretells.
        """
        p = self.covariance
        after = np.linalg.solve(np.eye(len(p)) + p @ information, p)
        self.covariance = 0.5 * (after + after.T)
        self.theta_rad = self.theta_rad + self.covariance @ gain

    def snapshot(self) -> object:
        """The state, to be given to `restore`."""
        return self.theta_rad.copy(), self.covariance.copy()

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot."""
        if not isinstance(snapshot, tuple):
            raise TypeError("not a snapshot of these headings")
        self.theta_rad, self.covariance = (part.copy() for part in snapshot)
