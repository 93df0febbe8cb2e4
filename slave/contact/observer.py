"""The torque from outside at each joint, by a generalised-momentum observer (De Luca and Mattone 2005)."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import build_model, unit_rates

LONGEST_S = 0.025
"""With more time than this between two readings it is not known what happened meanwhile: begin anew."""
_SETTLED = 12.0
"""After so many time constants the residual no longer depends on where it began."""


class MomentumObserver:
    """Estimates external torques (J,) from angles and motor torques. Give it each reading once.

    With momentum p = M(q) q̇ the robot obeys ṗ = τ + Cᵀ(q, q̇) q̇ - g(q) + τ_ext, and the residual
    r = K (p - ∫ (τ + Cᵀ q̇ - g + r) dt) obeys ṙ = K (τ_ext - r). From one reading to the next the increment of
    p - ∫ (τ + Cᵀ q̇ - g) dt is M Δq̇ + (C q̇ + g - τ) Δt, since Ṁ = C + Cᵀ. Angles are quantised, so that
    increment passes two more poles of the same time constant 1/K: r = τ_ext / (1 + s/K)³.
    """

    def __init__(
        self, skeleton: Skeleton, time_constant_s: float, model: mujoco.MjModel | None = None
    ) -> None:
        """`time_constant_s`: 1/K. `model`: the robot's; None: that of the skeleton."""
        self.model = build_model(skeleton) if model is None else model
        self.data = mujoco.MjData(self.model)
        self.rates: Array = unit_rates(skeleton, self.model)
        """(J, hinges)"""
        self._time_constant_s = time_constant_s
        self._inertial, self._bias = np.empty(self.model.nv), np.empty(self.model.nv)
        self.restart()

    def restart(self) -> None:
        """Forget what was: nothing is known of the motion."""
        joints = len(self.rates)
        self._read_ns: int | None = None
        self._step_s = 0.0
        self._known_s = 0.0
        self._position_rad, self._velocity_rad_s, self._effort_nm = np.zeros((3, joints))
        self._poles = np.zeros((3, 3, joints))

    @property
    def ready(self) -> bool:
        """Whether the estimate no longer depends on how it began."""
        return self._known_s > _SETTLED * self._time_constant_s

    @property
    def external_nm(self) -> Array:
        """(J,) the residual r, positive where the robot is pushed in a joint's positive direction."""
        out: Array = self._poles[2, 0]
        return out

    @property
    def model_nm(self) -> Array:
        """(J,) |M q̈| + |C q̇ + g| after the same poles: what an error of the model would be a share of."""
        out: Array = self._poles[2, 1]
        return out

    @property
    def effort_rate_nm_s(self) -> Array:
        """(J,) |dτ/dt| after the same poles: what a torque that comes late is wrong by for each second."""
        out: Array = self._poles[2, 2]
        return out

    def update(self, read_ns: int, position_rad: Array, effort_nm: Array) -> None:
        """Take angles and motor torques (J,) read at one time, ns; NaN torques make NaN residuals."""
        before_ns, self._read_ns = self._read_ns, read_ns
        if before_ns is None:
            self._position_rad, self._effort_nm = position_rad, effort_nm
            return
        step_s = to_s(read_ns - before_ns)
        if not 0.0 < step_s <= LONGEST_S:
            self.restart()
            self._read_ns, self._position_rad, self._effort_nm = read_ns, position_rad, effort_nm
            return
        # the mean velocity since the last reading is that of the moment between the two
        velocity = (position_rad - self._position_rad) / step_s
        if self._step_s > 0.0:
            between_s = 0.5 * (self._step_s + step_s)
            effort_rate = (effort_nm - self._effort_nm) / step_s
            self._advance(velocity, between_s, 0.5 * (self._effort_nm + effort_nm), effort_rate)
        self._position_rad, self._velocity_rad_s = position_rad, velocity
        self._effort_nm, self._step_s = effort_nm, step_s

    def _advance(
        self, velocity_rad_s: Array, elapsed_s: float, effort_nm: Array, effort_rate_nm_s: Array
    ) -> None:
        """Move on from the middle of the last interval to that of this one, around the last reading."""
        model, data, rates = self.model, self.data, self.rates
        sped_up = velocity_rad_s - self._velocity_rad_s
        data.qpos[:] = self._position_rad @ rates
        data.qvel[:] = (0.5 * (velocity_rad_s + self._velocity_rad_s)) @ rates
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, self._bias)
        mujoco.mj_mulM(model, data, self._inertial, (sped_up / elapsed_s) @ rates)
        inertial, bias = rates @ self._inertial, rates @ self._bias
        value = np.stack(
            (inertial + bias - effort_nm, np.abs(inertial) + np.abs(bias), np.abs(effort_rate_nm_s))
        )
        # a joint that is heard again begins anew
        np.copyto(self._poles, 0.0, where=np.isnan(self._poles) & ~np.isnan(value))
        share = -math.expm1(-elapsed_s / self._time_constant_s)
        for pole in self._poles:
            pole += share * (value - pole)
            value = pole
        self._known_s += elapsed_s
