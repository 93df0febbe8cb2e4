"""A quaternion extended Kalman filter after Yuan et al. (Instrument Technique and Sensor 2022(9)), Section 3.

Prediction by the gyro, then two measurement updates, accelerometer and magnetometer (Eqs 38 to 40), over all
nodes at once. Three things differ from the paper:

- It estimates the *error* of the quaternion, a small rotation vector φ in the world frame,
  q_true = exp(φ/2) ⊗ q, in place of four components added up: three states, never off unit length. To first
  order that is the paper's filter seen through Δq = ½ φ ⊗ q. In the world frame both measurements are
  linear: the accelerometer sees φ's two horizontal components, the magnetometer's azimuth the vertical one.
- The gyro's bias is estimated too (three more states), in motion through the accelerometer and at rest from
  the gyro itself.
- The accelerometer's reading is compared with gravity as it is, not at unit length: a linear acceleration
  then averages out, since it is gone when the motion ends. Its noise grows with the linear acceleration of
  the last second, the magnetometer's with how unusual the field is, and that one turns only the heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from common.quaternion import (
    IDENTITY,
    Array,
    heading_turn,
    multiply,
    to_matrix,
)
from common.wire.messages import Mask
from master.orientation.ekf_equations import heading_update, predict, propagate, scalar_update, turn_by
from master.orientation.front import BehindFront, Front, FrontLimits, FrontSection
from master.orientation.mahony import begun_anew, initial_orientation
from master.orientation.rest import Rest, RestState

_GRAVITY_M_S2 = 9.81
_EAST, _NORTH, _UP = 0, 1, 2
_BIAS = slice(3, 6)
_REACH_RAD_S = math.radians(1.9)
_FAINTEST_UT = 1e-9
_DIP_RAD = math.radians(100.0)
"""Times the tolerance: a dip that far off is at the tolerance."""
_ACCELERATED_TAU_S = 1.0
_START_INCLINATION_RAD, _START_HEADING_RAD = 0.1, 0.2


class EkfConfig(FrontSection):
    """`[estimation.ekf]`. Noises are densities: the same values hold at every rate."""

    gyroscope_noise: float = Field(default=3e-3, gt=0.0, allow_inf_nan=False)
    """rad/s/√Hz, with what scale errors make of it in motion. More: the other two sensors pull faster."""
    bias_walk: float = Field(default=2e-5, ge=0.0, allow_inf_nan=False)
    """rad/s/√s: how fast the gyro's bias may wander. More: it is learnt faster, and less steadily."""
    accelerometer_noise: float = Field(default=0.1, gt=0.0, allow_inf_nan=False)
    """m/s²/√Hz, mostly the wearer's own acceleration. Over g and over `gyroscope_noise` it is the time
    constant, s, with which the inclination is corrected."""
    accelerated_m_s2: float = Field(default=3.0, gt=0.0, allow_inf_nan=False)
    """Linear acceleration, RMS over about the last second, at which the accelerometer's noise counts √2-fold.
    Less: the gyro carries the inclination through lively motion for longer."""
    heading_noise: float = Field(default=0.06, gt=0.0, allow_inf_nan=False)
    """rad/√Hz, of the magnetometer's azimuth. Over `gyroscope_noise` it is the heading's time constant, s."""
    field_tolerance: float = Field(default=0.1, gt=0.0, allow_inf_nan=False)
    """A field this share stronger or weaker than the usual, or with its dip off by as many radians × 1.75
    (0.1: 10°), counts as disturbed: with twice the noise there, and growing as the square. Less: stricter."""
    field_tau_s: float = Field(default=20.0, gt=0.0, allow_inf_nan=False)
    """Time constant, s, with which another field becomes the usual one."""
    start_bias_rad_s: float = Field(default=0.009, gt=0.0, allow_inf_nan=False)
    """Standard deviation of the gyro's bias at the start. More: the first seconds teach more of it."""
    bias_limit_rad_s: float = Field(default=0.1, gt=0.0, allow_inf_nan=False)
    """Bound on each axis of the learnt bias."""
    rest_noise: float = Field(default=4e-4, gt=0.0, allow_inf_nan=False)
    """rad/s/√Hz, of the gyro's reading at rest as its bias. More: rest teaches less."""

    def make(self, rate_hz: float, count: int) -> EkfFilter:
        """The filter for `count` nodes."""
        return EkfFilter(self, rate_hz, count)


@dataclass(slots=True)
class _EkfState:
    """n nodes."""

    q: Array
    """(n, 4)."""
    bias: Array
    """rad/s (n, 3)."""
    covariance: Array
    """(n, 6, 6) of φ (world) and of the bias (sensor)."""
    field: Array
    """The usual field's strength and dip, µT and rad (n, 2); NaN until a magnetometer speaks."""
    accelerated: Array
    """Mean square of the linear acceleration, m²/s⁴ (n,)."""
    pulled_rad: Array
    """How far the magnetometer has turned the heading since the start (n,)."""
    rest: RestState
    started: Mask


class EkfFilter(BehindFront):
    """An `OrientationFilter` of n nodes: prediction, two measurement updates, and one more at rest."""

    def __init__(self, config: EkfConfig, rate_hz: float, count: int) -> None:
        self._config = config
        self._period_s = 1.0 / rate_hz
        limits = FrontLimits(config.rest_bias_limit_deg_s, _REACH_RAD_S, config.field_change)
        self._front = Front(limits, rate_hz, count, self.q_inertial_from_sensor)
        self._rest = Rest()
        self._state = _EkfState(
            q=np.tile(IDENTITY, (count, 1)),
            bias=np.zeros((count, 3)),
            covariance=np.zeros((count, 6, 6)),
            field=np.full((count, 2), np.nan),
            accelerated=np.zeros(count),
            pulled_rad=np.zeros(count),
            rest=self._rest.start(count),
            started=np.zeros(count, dtype=np.bool_),
        )

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """One tick's readings, (n, 3) each."""
        config, state = self._config, self._state
        dt_s = self._period_s if dt_s is None else dt_s
        gyr_rad_s, acc_m_s2, mag_ut = self._front.take(gyr_rad_s, acc_m_s2, mag_ut, dt_s)
        if self._front.corrected is not None:
            self._begin_at_rest(self._front.corrected, acc_m_s2, mag_ut)
        state.q = propagate(state.q, gyr_rad_s - state.bias, dt_s)
        if not state.started.all():
            self._start(~state.started & acc_m_s2.any(axis=1), acc_m_s2, mag_ut)
        matrix = to_matrix(state.q)
        covariance = predict(state.covariance, matrix, dt_s, config.gyroscope_noise**2, config.bias_walk**2)
        correction = np.zeros((len(covariance), 6))
        self._take_accelerometer(correction, covariance, matrix, acc_m_s2, dt_s)
        self._take_magnetometer(correction, covariance, matrix, mag_ut, dt_s)
        self._take_rest(correction, covariance, gyr_rad_s, acc_m_s2, dt_s)
        state.covariance = covariance
        state.q = turn_by(correction[:, :3], state.q)
        limit = config.bias_limit_rad_s
        state.bias = np.clip(state.bias + correction[:, _BIAS], -limit, limit)

    def _start(self, new: Mask, acc: Array, mag: Array) -> None:
        state = self._state
        state.q[new] = initial_orientation(acc[new], mag[new])
        deviations = [_START_INCLINATION_RAD] * 2 + [_START_HEADING_RAD] + [self._config.start_bias_rad_s] * 3
        state.covariance[new] = np.diag(np.square(deviations))
        state.started |= new

    def _begin_at_rest(self, nodes: Mask, acc: Array, mag: Array) -> None:
        """Let gravity and field set the orientation anew, by which a gross bias has dragged it."""
        q = begun_anew(self._state.q[nodes], acc[nodes], mag[nodes])
        self.restart(nodes)
        self._start(nodes, acc, mag)
        self._state.q[nodes] = q

    def _take_accelerometer(
        self, correction: Array, covariance: Array, matrix: Array, acc: Array, dt_s: float
    ) -> None:
        linear = np.einsum("nij,nj->ni", matrix, acc)
        missing = ~acc.any(axis=1)
        linear[~missing, _UP] -= _GRAVITY_M_S2
        mean = self._state.accelerated
        mean += min(1.0, dt_s / _ACCELERATED_TAU_S) * (np.einsum("ni,ni->n", linear, linear) - mean)
        calm = (self._config.accelerometer_noise / _GRAVITY_M_S2) ** 2 / dt_s
        variance = calm * (1.0 + mean / self._config.accelerated_m_s2**2)
        variance[missing] = np.inf
        tilt = linear / _GRAVITY_M_S2
        scalar_update(correction, covariance, _EAST, tilt[:, _NORTH], variance)
        scalar_update(correction, covariance, _NORTH, -tilt[:, _EAST], variance)

    def _take_magnetometer(
        self, correction: Array, covariance: Array, matrix: Array, mag: Array, dt_s: float
    ) -> None:
        missing = np.isnan(mag[:, 0])
        if missing.all():
            return
        field = np.einsum("nij,nj->ni", matrix, mag)
        # a positive turn is from north to west: a field found east of north asks for it
        azimuth = np.arctan2(field[:, _EAST], field[:, _NORTH])
        noise = self._config.heading_noise * (1.0 + self._disturbance(field, dt_s))
        variance = noise * noise / dt_s
        if missing.any():
            azimuth[missing], variance[missing] = 0.0, np.inf
        self._state.pulled_rad += heading_update(correction, covariance, azimuth, variance)

    def _disturbance(self, field: Array, dt_s: float) -> Array:
        """0 in the usual field, 1 at the tolerance; field (n, 3), world, in, (n,) out; NaN from NaN."""
        config, usual = self._config, self._state.field
        squares = field * field
        level = squares[:, 0] + squares[:, 1]
        found = np.empty_like(usual)
        np.sqrt(level + squares[:, _UP], out=found[:, 0])
        np.arctan2(field[:, _UP], np.sqrt(level), out=found[:, 1])
        unknown = np.isnan(usual[:, 0])
        if unknown.any():
            usual[unknown] = found[unknown]
        off = found - usual
        moved = min(1.0, dt_s / config.field_tau_s) * off
        if np.isnan(found[:, 0]).any():
            moved[np.isnan(found[:, 0])] = 0.0
        usual += moved
        share = off[:, 0] / np.maximum(usual[:, 0], _FAINTEST_UT) / config.field_tolerance
        tilt = off[:, 1] / (_DIP_RAD * config.field_tolerance)
        out: Array = share * share + tilt * tilt
        return out

    def _take_rest(self, correction: Array, covariance: Array, gyr: Array, acc: Array, dt_s: float) -> None:
        still = self._rest.update(self._state.rest, gyr, acc, dt_s)
        if not still.any():
            return
        residual = self._state.rest.gyr_rad_s() - self._state.bias
        variance = np.where(still, self._config.rest_noise**2 / dt_s, np.inf)
        for axis in range(3):
            scalar_update(correction, covariance, 3 + axis, residual[:, axis], variance)

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4)."""
        return self._state.q.copy()

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (n, 4) with the magnetometer's turns about the vertical taken back."""
        return multiply(heading_turn(-self._state.pulled_rad), self._state.q)

    def bias_rad_s(self) -> Array:
        """Gyro biases (n, 3)."""
        return self._front.with_offset(self._state.bias.copy())

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""
        self._front.restart(nodes)
        state = self._state
        state.started[nodes] = False
        state.bias[nodes] = 0.0
        state.field[nodes] = np.nan
        state.accelerated[nodes] = 0.0
        state.pulled_rad[nodes] = 0.0
        state.rest.forget(nodes)
