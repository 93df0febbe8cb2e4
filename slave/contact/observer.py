"""The torque from outside at each joint, by a generalised-momentum observer (De Luca and Mattone 2005)."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.contact.stamps import SETTLED, StampNoise
from slave.model.build import build_model, unit_rates

LONGEST_S = 0.025
"""With more time than this between two readings it is not known what happened meanwhile: begin anew."""


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
        # fetched once, as every access builds a new view
        self._hinge_rad, self._hinge_rad_s = self.data.qpos, self.data.qvel
        self.rates: Array = unit_rates(skeleton, self.model)
        """(J, hinges)"""
        self._time_constant_s = time_constant_s
        self._inertial, self._bias = np.empty(self.model.nv), np.empty(self.model.nv)
        self._inertia = np.empty((self.model.nv, self.model.nv))
        self._joint_rates = np.abs(self.rates)
        self.restart()

    def restart(self) -> None:
        """Forget what was: nothing is known of the motion."""
        joints = len(self.rates)
        self._read_ns: int | None = None
        self._step_s = 0.0
        self._known_s = 0.0
        self._position_rad, self._velocity_rad_s, self._effort_nm = np.zeros((3, joints))
        self._poles = np.zeros((3, 3, joints))
        self._value = np.zeros((3, joints))
        self._unheard = False
        """Whether a torque was not known in the last reading."""
        self._stamps: StampNoise | None = None
        """None while all stamps are exact."""

    @property
    def ready(self) -> bool:
        """Whether the estimate no longer depends on how it began."""
        return self._known_s > SETTLED * self._time_constant_s

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

    @property
    def stamp_nm(self) -> Array | float:
        """(J,) what the errors of the readings' stamps can feign at most; 0 where stamps are exact."""
        return 0.0 if self._stamps is None else self._stamps.feigned_nm

    def update(self, read_ns: int, position_rad: Array, effort_nm: Array, stamp_error_s: float = 0.0) -> None:
        """Take angles and motor torques (J,) read at one time, ns; NaN torques make NaN residuals.

        The angles may have been taken `stamp_error_s` earlier or later.
        """
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
            self._doubt_stamp(step_s, stamp_error_s)
        self._position_rad, self._velocity_rad_s = position_rad, velocity
        self._effort_nm, self._step_s = effort_nm, step_s

    def _advance(
        self, velocity_rad_s: Array, elapsed_s: float, effort_nm: Array, effort_rate_nm_s: Array
    ) -> None:
        """Move on from the middle of the last interval to that of this one, around the last reading."""
        model, data, rates = self.model, self.data, self.rates
        sped_up = velocity_rad_s - self._velocity_rad_s
        self._hinge_rad[:] = self._position_rad @ rates
        self._hinge_rad_s[:] = (0.5 * (velocity_rad_s + self._velocity_rad_s)) @ rates
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, self._bias)
        mujoco.mj_mulM(model, data, self._inertial, (sped_up / elapsed_s) @ rates)
        inertial, bias = rates @ self._inertial, rates @ self._bias
        value = self._value
        value[0] = inertial + bias - effort_nm
        value[1] = np.abs(inertial) + np.abs(bias)
        value[2] = np.abs(effort_rate_nm_s)
        unheard = math.isnan(value.sum())
        if unheard or self._unheard:
            # a joint that is heard again begins anew
            np.copyto(self._poles, 0.0, where=np.isnan(self._poles) & ~np.isnan(value))
        self._unheard = unheard
        share = -math.expm1(-elapsed_s / self._time_constant_s)
        for pole in self._poles:
            pole += share * (value - pole)
            value = pole
        self._known_s += elapsed_s

    def _doubt_stamp(self, step_s: float, error_s: float) -> None:
        """Note how wrong the newest stamp may be, beside the momentum that `_advance` has just worked out."""
        if self._stamps is None:
            if not error_s:
                return
            self._stamps = StampNoise(len(self.rates), self._time_constant_s)
        model, data = self.model, self.data
        mujoco.mj_fullM(model, data, self._inertia)
        turning = np.abs(self._inertia) @ np.abs(self._hinge_rad_s)
        self._stamps.add(step_s, error_s, self._joint_rates @ turning)
