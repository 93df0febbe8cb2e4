"""A soft body in the way: a spring and a damper before a mass, free to move or clamped against a wall."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array

STIFFNESS_N_M = 10_000.0
"""ISO/TS 15066 names 10 kN/m for the abdomen, 75 for hands and face, 150 for the skull."""
MASS_KG = 4.0
DAMPING_RATIO = 0.2


GAP_M = 1e-3


class SoftPatient:
    """A face that stands at `face_m` (3,) and looks against `towards` (3,), a unit vector; no friction."""

    def __init__(self, face_m: Array, towards: Array, *, clamped: bool) -> None:
        self._face_m, self._towards = face_m, towards
        self._clamped = clamped
        self._damping_n_s_m = 2.0 * DAMPING_RATIO * math.sqrt(STIFFNESS_N_M * MASS_KG)
        self._moved_m = 0.0
        self._speed_m_s = 0.0
        self.force_n = 0.0
        """On the patient now."""
        self.peak_n = 0.0
        """The largest so far."""

    def push(self, point_m: Array, velocity_m_s: Array, step_s: float) -> Array:
        """The force (3,) N on a part of the robot at `point_m` (3,) with that velocity, for this step."""
        depth_m = float((point_m - self._face_m) @ self._towards) - self._moved_m
        approach_m_s = float(velocity_m_s @ self._towards) - self._speed_m_s
        touching = depth_m > 0.0
        spring = STIFFNESS_N_M * depth_m + self._damping_n_s_m * approach_m_s
        self.force_n = max(0.0, spring) if touching else 0.0
        self.peak_n = max(self.peak_n, self.force_n)
        if not self._clamped:
            self._speed_m_s += self.force_n / MASS_KG * step_s
            self._moved_m += self._speed_m_s * step_s
        out: Array = -self.force_n * self._towards
        return out


def in_the_way(point_m: Array, velocity_m_s: Array, *, clamped: bool) -> SoftPatient:
    """A patient right before a point (3,) that moves with a velocity (3,)."""
    towards = velocity_m_s / np.linalg.norm(velocity_m_s)
    return SoftPatient(point_m + GAP_M * towards, towards, clamped=clamped)
