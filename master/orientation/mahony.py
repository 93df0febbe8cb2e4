"""The complementary filter of Zuo, Yu and Gong (Acta Automatica Sinica 42(12), 2016), over all nodes at once.

Equations 1 to 12, in this project's frames (world east-north-up, accelerometer at rest reads upward) and
with two errors in print put right: Eq. 8 rotates into the sensor, not out of it; the magnetic error of
Eq. 9 is m̂ × û, not m̂ × v̂.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from common.quaternion import Array, conjugate, cross, heading_rad, heading_turn, multiply, to_matrix
from common.wire.messages import Mask
from master.orientation.front import BehindFront, Front, FrontLimits, FrontSection

_REACH_RAD_S = np.radians(0.5)
"""Its integral learns slowly, and about the vertical not at all without a magnetometer."""


class MahonyConfig(FrontSection):
    """`[estimation.mahony]`."""

    # the best of a coarse grid over the BROAD trials at hand: 5.9° total; 0.35 to 0.74 lie within 0.4°
    kp: float = Field(default=0.5, ge=0.0, allow_inf_nan=False)
    """K_p, 1/s: how fast accelerometer and magnetometer pull; time constant 1 / K_p."""
    ki: float = Field(default=0.0012, ge=0.0, allow_inf_nan=False)
    """K_i, 1/s²: how fast the gyro's bias is learnt; 0 learns none."""
    bias_limit_rad_s: float = Field(default=0.1, ge=0.0, allow_inf_nan=False)
    """Bound on each axis of the learnt bias; 0 for none."""

    def make(self, rate_hz: float, count: int) -> MahonyFilter:
        """The filter for `count` nodes."""
        return MahonyFilter(self, rate_hz, count)


class MahonyFilter(BehindFront):
    """An `OrientationFilter` of n nodes with proportional-integral feedback."""

    def __init__(self, config: MahonyConfig, rate_hz: float, count: int) -> None:
        self._config = config
        self._period_s = 1.0 / rate_hz
        limit_deg_s = config.rest_bias_limit_deg_s if config.ki > 0.0 else 0.0
        limits = FrontLimits(limit_deg_s, float(_REACH_RAD_S), config.field_change, any_field=False)
        self._front = Front(limits, rate_hz, count, self.q_inertial_from_sensor)
        self._q = np.zeros((count, 4))
        self._q[:, 0] = 1.0
        self._error = np.zeros((count, 3))
        # the magnetometer's part of it, about the vertical
        self._turn = np.zeros(count)
        # K_i ∫ e dt, rad/s
        self._integral = np.zeros((count, 3))
        # how far the magnetometer has turned the heading since the start
        self._pulled_rad = np.zeros(count)
        self._started = np.zeros(count, dtype=np.bool_)

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """One tick's readings, (n, 3) each."""
        period_s = self._period_s if dt_s is None else dt_s
        gyr_rad_s, acc_m_s2, mag_ut = self._front.take(gyr_rad_s, acc_m_s2, mag_ut, dt_s)
        if self._front.corrected is not None:
            self._begin_at_rest(self._front.corrected, acc_m_s2, mag_ut)
        rate = gyr_rad_s + self._config.kp * self._error + self._integral  # Eqs 10, 11
        self._q = integrate(self._q, rate, period_s)  # Eq. 12
        if not self._started.all():
            new = ~self._started & acc_m_s2.any(axis=1)
            self._q[new] = initial_orientation(acc_m_s2[new], mag_ut[new])
            self._started[new] = True
        self._pulled_rad += (self._config.kp * period_s) * self._turn
        # taken at the orientation that belongs to these readings, and fed back in the next period
        self._error, self._turn = attitude_error(self._q, acc_m_s2, mag_ut)
        self._learn_bias(period_s)

    def _begin_at_rest(self, nodes: Mask, acc: Array, mag: Array) -> None:
        """Let gravity and field set the orientation anew, by which a gross bias has dragged it."""
        q = begun_anew(self._q[nodes], acc[nodes], mag[nodes])
        self.restart(nodes)
        self._q[nodes], self._started[nodes] = q, True

    def _learn_bias(self, period_s: float) -> None:
        config = self._config
        if config.ki > 0.0:
            self._integral += config.ki * period_s * self._error
            if config.bias_limit_rad_s > 0.0:
                limit = config.bias_limit_rad_s
                np.clip(self._integral, -limit, limit, out=self._integral)

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4)."""
        return self._q.copy()

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (n, 4) with the magnetometer's turns about the vertical taken back."""
        return multiply(heading_turn(-self._pulled_rad), self._q)

    def bias_rad_s(self) -> Array:
        """Gyro biases (n, 3): the integral with its sign turned."""
        return self._front.with_offset(-self._integral)

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""
        self._front.restart(nodes)
        self._started[nodes] = False
        self._integral[nodes] = 0.0
        self._error[nodes] = 0.0
        self._turn[nodes] = 0.0
        self._pulled_rad[nodes] = 0.0


def attitude_error(q_world_from_sensor: Array, acc: Array, mag: Array) -> tuple[Array, Array]:
    """Eqs 4 to 9: the rotation, rad about sensor axes (n, 3), that small errors of q (n, 4) ask for.

    Beside it the magnetometer's part alone, rad about the vertical (n,): of Eq. 9's m̂ × û only that
    component is taken, so that a disturbed field turns the heading and never the inclination.
    Only the directions of `acc` and `mag` (n, 3) count. A NaN or zero row pulls at nothing.
    """
    matrix = to_matrix(q_world_from_sensor)  # Eq. 4, C_b^n
    measured = _directions(np.stack([acc, mag]))  # â, m̂
    field = np.einsum("nij,nj->ni", matrix, measured[1])  # Eq. 6
    up = matrix[:, 2]  # Eq. 5, v̂: up, seen from the sensor
    # Eqs 7 to 9 about the vertical: the field as found, (x, y, ·), times as it should be, (0, |x, y|, ·)
    turn = field[:, 0] * np.hypot(field[:, 0], field[:, 1])
    error: Array = cross(measured[0], up) + turn[:, None] * up
    return error, turn


def integrate(q: Array, rate_rad_s: Array, period_s: float) -> Array:
    """Eq. 3: one first-order step of q̇ = ½ q ⊗ (0, ω), then unit length again. (n, 4), (n, 3) → (n, 4)."""
    step = np.empty_like(q)
    step[:, 0] = 1.0
    step[:, 1:] = (0.5 * period_s) * rate_rad_s
    q = multiply(q, step)
    q /= np.sqrt(np.einsum("ni,ni->n", q, q))[:, None]
    return q


def initial_orientation(acc: Array, mag: Array) -> Array:
    """In place of Eq. 1: orientations (n, 4) with `acc` up and `mag` northward.

    Without `mag` the heading is that of the shortest turn from the sensor's frame.
    """
    up = _directions(acc)
    # the shortest turn that brings `up` to the vertical: (1 + cos, sin · axis), up × z
    q = np.stack([1.0 + up[:, 2], up[:, 1], -up[:, 0], np.zeros(len(up))], axis=-1)
    q[q[:, 0] < 1e-9] = [0.0, 1.0, 0.0, 0.0]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    field = np.einsum("nij,nj->ni", to_matrix(q), _directions(mag))
    return multiply(heading_turn(np.arctan2(field[:, 0], field[:, 1])), q)


def begun_anew(q: Array, acc: Array, mag: Array) -> Array:
    """Orientations (n, 4) at rest by gravity and field; without a field the heading stays that of `q`."""
    out = initial_orientation(acc, mag)
    blind = np.isnan(mag[:, 0])
    kept = heading_rad(multiply(q[blind], conjugate(out[blind])))
    out[blind] = multiply(heading_turn(kept), out[blind])
    return out


def _directions(v: Array) -> Array:
    """Vectors (..., 3) at unit length; zero where one is NaN or zero."""
    length = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None]
    known = length > 0.0
    out: Array = v / length if known.all() else np.divide(v, length, out=np.zeros_like(v), where=known)
    return out
