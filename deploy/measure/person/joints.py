"""Two neighbours on a body share a joint: its acceleration is the same from both sides (Seel et al. 2012).

    |a₁ − Γ(ω₁) r₁| = |a₂ − Γ(ω₂) r₂|,   Γ(ω) r = ω̇ × r + ω × (ω × r)

r is from the joint to the node. It does not change, whatever the person does: it is found by Gauss and
Newton, and what is left tells whether the two nodes hang on one joint at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from common.quaternion import Array
from common.wire.messages import Mask

SMOOTH_S = 0.06
MOST = 3000
"""Samples that are taken."""
_STEPS = 25


@dataclass(frozen=True, slots=True)
class SharedJoint:
    """Of two neighbours."""

    residual_m_s2: float
    """RMS of the difference of both sides' accelerations."""
    motion_m_s2: float
    """RMS of how much the acceleration changes at all: with little, nothing is known."""
    distances_m: tuple[float, float]
    """From the joint to each node."""


def shared_joint(first: tuple[Array, Array], second: tuple[Array, Array], rate_hz: float) -> SharedJoint:
    """Of two nodes' accelerometers and gyros, (T, 3) each; NaN where one did not answer."""
    sides = [_levers(*node, rate_hz) for node in (first, second)]
    known = np.isfinite(sides[0][0]).all(axis=1) & np.isfinite(sides[1][0]).all(axis=1)
    fast = np.linalg.norm(first[1], axis=1) + np.linalg.norm(second[1], axis=1)
    rows = np.flatnonzero(known & np.isfinite(fast))
    rows = np.sort(rows[np.argsort(-fast[rows])][:MOST])
    (a1, g1), (a2, g2) = [(acc[rows], lever[rows]) for acc, lever in sides]
    r = np.zeros(6)
    for _ in range(_STEPS):
        u1, u2 = a1 - g1 @ r[:3], a2 - g2 @ r[3:]
        n1, n2 = (np.linalg.norm(u, axis=1) + 1e-9 for u in (u1, u2))
        j1 = -np.einsum("ti,tij->tj", u1 / n1[:, None], g1)
        j2 = -np.einsum("ti,tij->tj", u2 / n2[:, None], g2)
        e = n1 - n2
        weight = 1.0 / np.sqrt(1.0 + (e / (1.5 * np.median(np.abs(e)) + 1e-9)) ** 2)
        jacobian = np.hstack([j1, -j2]) * weight[:, None]
        # a little damping: along an axis that never turned the joint's place is not known
        normal = jacobian.T @ jacobian + 1e-3 * len(rows) * np.eye(6)
        r -= np.linalg.solve(normal, jacobian.T @ (e * weight) + 1e-3 * len(rows) * r)
    e = np.linalg.norm(a1 - g1 @ r[:3], axis=1) - np.linalg.norm(a2 - g2 @ r[3:], axis=1)
    motion = 0.5 * (np.linalg.norm(a1, axis=1).std() + np.linalg.norm(a2, axis=1).std())
    left = float(np.sqrt(np.median(e**2)) * 1.4826)
    return SharedJoint(left, float(motion), (float(np.linalg.norm(r[:3])), float(np.linalg.norm(r[3:]))))


def _levers(acc_m_s2: Array, gyr_rad_s: Array, rate_hz: float) -> tuple[Array, Array]:
    """Accelerations (T, 3), NaN near what is missing, and the matrices Γ (T, 3, 3) of the smoothed rates."""
    width = max(3, round(SMOOTH_S * rate_hz))
    missing: Mask = np.asarray(~np.isfinite(np.hstack([acc_m_s2, gyr_rad_s])).all(axis=1))
    # a running mean never forgets a NaN: it would take all that follows with it
    acc, gyr = (
        uniform_filter1d(np.where(missing[:, None], 0.0, values), width, axis=0)
        for values in (acc_m_s2, gyr_rad_s)
    )
    acc[maximum_filter1d(missing, width + 2)] = np.nan  # the slope takes one more on each side
    turning = np.gradient(gyr, 1.0 / rate_hz, axis=0)
    squared = np.einsum("ti,tj->tij", gyr, gyr) - np.eye(3) * (gyr**2).sum(axis=1)[:, None, None]
    x, y, z = turning.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return acc, cross + squared
