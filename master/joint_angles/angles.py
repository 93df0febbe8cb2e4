"""Intrinsic angles of many rotations at once, by atan2 only.

Each rotation is R = Rx(α) Ry(β) Rz(γ) in its own right-handed axis frame (`Skeleton.axis_frames`):

    R00 = cβ cγ    R01 = -cβ sγ    R02 = sβ    R12 = -sα cβ    R22 = cα cβ
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array


def intrinsic_angles(matrix: Array) -> Array:
    """α in [-π, π], β in [-π/2, π/2], γ in [-π, π], as rows (3, n), of rotation matrices (n, 3, 3).

    Where cos β = 0 only α ± γ is known; both are then finite and arbitrary.
    """
    r00, r01, r02 = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2]
    out = np.empty((3, len(matrix)))
    np.arctan2(-matrix[:, 1, 2], matrix[:, 2, 2], out=out[0])
    np.arctan2(r02, np.hypot(r00, r01), out=out[1])
    np.arctan2(-r01, r00, out=out[2])
    return out
