"""Rates of the intrinsic angles from rotation rates, in closed form.

With ω in the rotated frame, R = Rx(α) Ry(β) Rz(γ):

    ωx =  cβ cγ α̇ + sγ β̇        α̇ = (cγ ωx - sγ ωy) / cβ
    ωy = -cβ sγ α̇ + cγ β̇        β̇ =  sγ ωx + cγ ωy
    ωz =  sβ α̇ + γ̇              γ̇ =  ωz - sβ α̇
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array

COSINE_FLOOR = np.sin(np.radians(2.0))
"""Within 2° of β = ±90° the rates are divided by this in place of cos β: bounded, and no longer exact."""


def angle_rates(matrix: Array, rate_rad_s: Array) -> Array:
    """α̇, β̇, γ̇ as rows (3, n), rad/s, at rotation matrices R (n, 3, 3), for ω (n, 3) rad/s."""
    r00, r01, r02 = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2]
    wx, wy, wz = rate_rad_s[:, 0], rate_rad_s[:, 1], rate_rad_s[:, 2]
    cosine = np.maximum(np.hypot(r00, r01), COSINE_FLOOR)
    c, s = r00 / cosine, -r01 / cosine
    out = np.empty((3, len(matrix)))
    out[0] = (c * wx - s * wy) / cosine
    out[1] = s * wx + c * wy
    out[2] = wz - r02 * out[0]
    return out
