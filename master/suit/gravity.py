"""Whether a node's gyro turns as its accelerometer sees gravity turn. Pure.

Two low-passes of the specific force in the node's own frame, one short, one long, are both carried along by
the gyro (as VQF low-passes in an inertial frame, Laidig & Seel 2023, section 3.2):

    v ← R(ω dt)ᵀ v,    v ← v + (1 − e^(−dt/τ)) (f − v)

Where the gyro is right both point up, whatever the motion: accelerations of a body that stays in a room
average out. A gyro that is dead, has a wrong sign or swapped axes carries the long one elsewhere than the
short one, as soon as the node turns. So the evidence comes with the motion: some 35° of turn.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

SHORT_S, LONG_S = 0.8, 3.0
_AGREES_DEG = 15.0
_AGREED_RAD = 2.0
"""A gyro that was not believed must carry gravity through so much turn, in agreement, to be so again."""
_IN_A_ROW = 3
_LARGEST_BIAS_RAD_S = math.radians(30.0)
_STILL_S = 1.5
_STAYS: Array = np.repeat([0.25, math.radians(2.0)], 3)
"""m/s², rad/s: how far a still node's readings may be from those with which its stillness began."""
_TURNING_RAD_S = math.radians(5.0)
_LONGEST_STEP_S = 0.2

_ONE = np.eye(3)
_SKEW = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], float
)
"""(3, 9): θ times this is the matrix, row by row, by which v becomes v × θ."""


class GravityWatch:
    """State of N nodes."""

    def __init__(self, count: int, limit_deg: float, affine: Array | None = None) -> None:
        """`affine` (3, N, 3, 4) of accelerometer, gyro and magnetometer; None: as they come."""
        self._limit_cos = math.cos(math.radians(limit_deg)) if limit_deg < 180.0 else -2.0
        # where no file calibrates, nothing is to be applied
        as_they_come = affine is None or bool((affine[:2] == np.eye(3, 4)).all())
        self._affine = None if as_they_come else affine
        self._memory = np.full((count, 2, 3), np.nan)
        self._bias_rad_s = np.zeros((count, 3))
        self._quiet_mean = np.zeros((count, 3))
        self._quiet_s = np.zeros(count)
        self._quiet_since = np.zeros((count, 6))
        self._dt_s = 0.0
        self._beyond = np.zeros(count, np.int64)
        self._agreed_rad = np.zeros(count)
        self.contradicted: Mask = np.zeros(count, np.bool_)
        """(N,) until the gyro has been seen to be right."""
        self.worst_deg = np.zeros(count)
        self.turned_rad = np.zeros(count)
        """(N,) by how much each node turned in the last step; what is slower than 5 °/s is none."""

    def calibrated_acc(self, acc_m_s2: Array) -> Array:
        """Specific force (N, 3) after calibration."""
        return acc_m_s2 if self._affine is None else _affine(self._affine[0], acc_m_s2)

    def learn_bias(self, quiet: Mask, acc_m_s2: Array, gyr_rad_s: Array) -> None:
        """What a gyro reads while its node is still is its bias, raw (N, 3); up to 30 °/s.

        To be called at every second `update`.

        A slow, steady turn is quiet too: so gravity, calibrated (N, 3), must stay where it is as well.
        """
        if not quiet.any():
            self._quiet_s[:] = 0.0
            return
        rate = gyr_rad_s if self._affine is None else _affine(self._affine[1], gyr_rad_s)
        now = np.concatenate([acc_m_s2, rate], axis=1)
        same = quiet & (np.abs(now - self._quiet_since) < _STAYS).all(axis=1)
        self._quiet_since = np.where(same[:, None], self._quiet_since, now)
        share = np.where(same, 0.19, 1.0)[:, None]
        self._quiet_mean += share * (rate - self._quiet_mean)
        self._quiet_s = (self._quiet_s + 2.0 * self._dt_s) * same
        known = (self._quiet_s > _STILL_S) & (np.abs(self._quiet_mean).max(axis=1) < _LARGEST_BIAS_RAD_S)
        if known.any():
            self._bias_rad_s[known] = self._quiet_mean[known]

    def update(self, acc_m_s2: Array, gyr_rad_s: Array, dt_s: float, silent: Mask) -> None:
        """Means (N, 3) of the raw readings over the last `dt_s`; `silent` (N,) start anew."""
        self._dt_s = dt_s
        if dt_s <= 0.0 or dt_s > _LONGEST_STEP_S:
            self._dt_s, silent = 0.0, np.ones_like(silent)
        acc = self.calibrated_acc(acc_m_s2)
        rate = gyr_rad_s if self._affine is None else _affine(self._affine[1], gyr_rad_s)
        turn = self._dt_s * (rate - self._bias_rad_s)
        memory = self._memory
        anew = silent | np.isnan(memory[:, 0, 0])
        if anew.any():
            memory[anew] = acc[anew, None]
        # v R(ω dt), to second order in the turn of one step: some degrees
        skew = np.matmul(turn, _SKEW).reshape(-1, 3, 3)
        memory = self._memory = np.matmul(memory, _ONE + skew + 0.5 * np.matmul(skew, skew))
        shares = [[1.0 - math.exp(-self._dt_s / tau)] for tau in (SHORT_S, LONG_S)]
        memory += np.array(shares) * (acc[:, None] - memory)
        self._compare(turn, anew)

    def _compare(self, turn: Array, anew: Mask) -> None:
        products = np.matmul(self._memory, self._memory.transpose(0, 2, 1))
        long_squared = np.maximum(products[:, 1, 1], 1e-9)
        cos = products[:, 0, 1] / np.sqrt(np.maximum(products[:, 0, 0], 1e-9) * long_squared)
        self._beyond = (self._beyond + 1) * ((cos < self._limit_cos) & ~anew)
        angle = np.sqrt(np.einsum("ni,ni->n", turn, turn))
        self.turned_rad = np.where(angle > _TURNING_RAD_S * self._dt_s, angle, 0.0)
        fresh = (self._beyond >= _IN_A_ROW) & ~self.contradicted
        if not (fresh.any() or self.contradicted.any()):
            return
        apart_deg = np.degrees(np.arccos(np.clip(cos, -1.0, 1.0)))
        self.worst_deg = np.where(fresh, apart_deg, np.maximum(self.worst_deg, apart_deg))
        tilted = np.cross(self._memory[:, 1], turn)
        path_rad = np.sqrt(np.einsum("ni,ni->n", tilted, tilted) / long_squared)
        agrees = (apart_deg < _AGREES_DEG) & ~anew & ~fresh
        self._agreed_rad = (self._agreed_rad + path_rad * (self.turned_rad > 0.0)) * agrees
        self.contradicted = (self.contradicted | fresh) & ~(self._agreed_rad > _AGREED_RAD)


def _affine(matrices: Array, readings: Array) -> Array:
    out: Array = np.matmul(matrices[:, :, :3], readings[:, :, None])[:, :, 0] + matrices[:, :, 3]
    return out
