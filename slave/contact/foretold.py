"""The torque that each drive will give, foretold from setpoints by a model of robot and drives. Pure."""

from __future__ import annotations

import math
from collections import deque

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import unit_rates

KEPT_S = 0.025
"""Drives take a setpoint in late, and answer a little sooner or later than the model of them: what was needed
so long ago may still be."""
STAIR = 0.3
"""Share of a stair that an observer mistakes, seen in the simulated robot."""
LONGEST_S = 0.1
"""With more time than this between two setpoints their motion is not known."""


class ForetoldTorque:
    """Follows J setpoints. What a drive needs is told by a model of the whole robot, drives included.

    A drive answers its setpoint s like  q'' = ω² (s - q) - √2 ω q'  with ω = 2π `drive_hz`, so that it lags
    by √2 / ω. That is solved exactly from one setpoint to the next. The torque is then M q'' + C q' + g.
    Nobody who pushes the robot changes it.
    """

    def __init__(self, skeleton: Skeleton, drive_hz: float, model: mujoco.MjModel) -> None:
        """`model`: the robot's, with what it carries."""
        self._omega = 2.0 * math.pi * drive_hz
        self._model, self._data = model, mujoco.MjData(model)
        self._rates: Array = unit_rates(skeleton, model)
        self._inertial, self._bias = np.empty(model.nv), np.empty(model.nv)
        self._needed: deque[tuple[float, Array]] = deque()
        """Age in s and torque (J,), newest last."""
        self._stair_nm = np.zeros(len(self._rates))
        self._position_rad: Array | None = None
        self._velocity_rad_s = np.zeros(len(self._rates))

    def forget(self) -> None:
        """The joints stand where nobody knows: it begins anew."""
        self._position_rad = None
        self._needed.clear()

    def step(self, dt_s: float, stand_rad: Array, setpoint_rad: Array) -> tuple[Array, Array]:
        """(J,) each: M q'' and C q' + g now, N m at the joint, for setpoints (J,) written now.

        `stand_rad` (J,): where the joints are, at rest, when it begins.
        """
        known = self._position_rad is not None and math.isfinite(self._position_rad.sum())
        if self._position_rad is None or not known or not 0.0 < dt_s <= LONGEST_S:
            self._needed.clear()
            self._position_rad, self._velocity_rad_s = stand_rad, np.zeros_like(stand_rad)
            dt_s = 0.0
        inertial, bias = self._torques(self._answer(dt_s, self._position_rad, setpoint_rad))
        self._needed = deque((age + dt_s, needed) for age, needed in self._needed if age + dt_s <= KEPT_S)
        self._needed.append((0.0, inertial + bias))
        self._stair_nm = np.abs(self._inertia_times(self._omega**2 * dt_s * self._velocity_rad_s))
        return inertial, bias

    @property
    def sudden_nm(self) -> Array:
        """(J,) by how much the torque may jump: what it has changed by within `KEPT_S`, and part of a stair.

        A drive's cycle without a new setpoint, or with two, is a stair: M ω² q' Δt.
        """
        if not self._needed:
            return self._stair_nm
        out: Array = np.ptp([torque for _, torque in self._needed], axis=0) + STAIR * self._stair_nm
        return out

    def _answer(self, dt_s: float, position_rad: Array, setpoint_rad: Array) -> Array:
        """(J,) acceleration once the drives have answered a setpoint for so long.

        They oscillate about it, damped: with a = ω / √2 the distance is  e^-at (c cos at + d sin at).
        """
        omega = self._omega
        a = omega / math.sqrt(2.0)
        away, rate = position_rad - setpoint_rad, self._velocity_rad_s
        decay, cos, sin = math.exp(-a * dt_s), math.cos(a * dt_s), math.sin(a * dt_s)
        away, rate = (
            decay * (away * cos + (rate / a + away) * sin),
            decay * (rate * cos - (2.0 * a * away + rate) * sin),
        )
        self._position_rad, self._velocity_rad_s = setpoint_rad + away, rate
        out: Array = -(omega**2) * away - 2.0 * a * rate
        return out

    def _torques(self, acceleration_rad_s2: Array) -> tuple[Array, Array]:
        """(J,) each: M q'' and C q' + g."""
        model, data, rates = self._model, self._data, self._rates
        assert self._position_rad is not None
        data.qpos[:] = self._position_rad @ rates
        data.qvel[:] = self._velocity_rad_s @ rates
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, self._bias)
        return self._inertia_times(acceleration_rad_s2), rates @ self._bias

    def _inertia_times(self, acceleration_rad_s2: Array) -> Array:
        mujoco.mj_mulM(self._model, self._data, self._inertial, acceleration_rad_s2 @ self._rates)
        out: Array = self._rates @ self._inertial
        return out
