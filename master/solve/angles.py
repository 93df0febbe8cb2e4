"""Intrinsic angles of many rotations at once, by atan2 only.

Each rotation is R = Rx(α) Ry(β) Rz(γ) in its own right-handed axis frame (`Skeleton.axis_frames`):

    R00 = cβ cγ    R01 = -cβ sγ    R02 = sβ    R12 = -sα cβ    R22 = cα cβ
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array


def _products() -> Array:
    """(16, 5): (q outer q) flattened times this gives R00, R01, R02, R12, R22."""
    w, x, y, z = 0, 1, 2, 3
    terms: list[list[tuple[int, int, float]]] = [
        [(w, w, 1.0), (x, x, 1.0), (y, y, -1.0), (z, z, -1.0)],
        [(x, y, 2.0), (w, z, -2.0)],
        [(x, z, 2.0), (w, y, 2.0)],
        [(y, z, 2.0), (w, x, -2.0)],
        [(w, w, 1.0), (x, x, -1.0), (y, y, -1.0), (z, z, 1.0)],
    ]
    out = np.zeros((4, 4, 5))
    for element, products in enumerate(terms):
        for a, b, factor in products:
            out[a, b, element] = factor
    return out.reshape(16, 5)


_PRODUCTS = _products()


def elements(q: Array) -> Array:
    """R00, R01, R02, R12, R22 of unit quaternions (n, 4), as rows (5, n)."""
    outer = (q[:, :, None] * q[:, None, :]).reshape(-1, 16)
    out: Array = (outer @ _PRODUCTS).T
    return out


def intrinsic_angles(r: Array) -> Array:
    """α in (-π, π], β in [-π/2, π/2], γ in (-π, π], as rows (3, n), of `elements` (5, n).

    Where cos β = 0 only α ± γ is known; both are then finite and arbitrary.
    """
    r00, r01, r02, r12, r22 = r
    out = np.empty((3, r.shape[1]))
    np.arctan2(-r12, r22, out=out[0])
    np.arctan2(r02, np.hypot(r00, r01), out=out[1])
    np.arctan2(-r01, r00, out=out[2])
    return out
