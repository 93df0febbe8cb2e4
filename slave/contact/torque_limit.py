"""How hard each drive may turn now: what the motion needs by the robot's model, and a margin. Pure.

A position drive that is held up pushes harder and harder, up to its own limit. With this limit it never
pushes harder than moving or standing needs, without anything having to be noticed first. What standing needs
is always allowed: an arm that speeds up downwards needs next to nothing, but a drive whose slave dies then
must hold it with what it was told last.
"""

from __future__ import annotations

import math
from collections import deque

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.contact.config import ContactConfig
from slave.model.build import unit_rates

MARGIN = 1.25
"""Thresholds: a drive at its limit pushes hard enough to be noticed."""
KEPT_S = 0.025
"""Drives take a setpoint in late, and answer a little sooner or later than the model of them: what was needed
so long ago may still be."""
LONGEST_S = 0.1
"""With more time than this between two setpoints their motion is not known."""


class TorqueLimit:
    """Follows J setpoints. What a drive needs is told by a model of the whole robot, drives included.

    A drive answers its setpoint s like  q'' = ω² (s - q) - √2 ω q'  with ω = 2π `drive_hz`, so that it lags
    by √2 / ω. That is solved exactly from one setpoint to the next. The torque is then M q'' + C q' + g.
    """

    def __init__(self, skeleton: Skeleton, config: ContactConfig, model: mujoco.MjModel) -> None:
        """`model`: the robot's, with what it carries."""
        self._config = config
        self._model, self._data = model, mujoco.MjData(model)
        self._rates: Array = unit_rates(skeleton, model)
        self._inertial, self._bias = np.empty(model.nv), np.empty(model.nv)
        self._needed: deque[tuple[float, Array, Array]] = deque()
        """Age in s, least and greatest torque (J,), newest last."""
        self._position_rad: Array | None = None
        self._velocity_rad_s = np.zeros(len(self._rates))

    def forget(self) -> None:
        """Nobody follows anybody: drives may give what they have."""
        self._position_rad = None
        self._needed.clear()

    def step(self, dt_s: float, stand_rad: Array, setpoint_rad: Array, floor_nm: Array) -> Array | None:
        """(2, J) least and greatest torque, N m at the joint, for setpoints (J,) written now.

        `stand_rad` (J,): where the joints are, at rest, when it begins. `floor_nm` (J,): the thresholds of a
        robot whose motors do nothing. None where the limit is switched off.
        """
        if not self._config.torque_limit:
            return None
        if self._position_rad is None or not 0.0 < dt_s <= LONGEST_S:
            self._needed.clear()
            self._position_rad, self._velocity_rad_s = stand_rad, np.zeros_like(stand_rad)
            dt_s = 0.0
        acceleration = self._answer(dt_s, self._position_rad, setpoint_rad)
        inertial, bias = self._torques(acceleration)
        margin = MARGIN * (floor_nm + self._config.model_error * (np.abs(inertial) + np.abs(bias)))
        needed = inertial + bias
        self._needed = deque((age + dt_s, a, b) for age, a, b in self._needed if age + dt_s <= KEPT_S)
        self._needed.append((0.0, np.minimum(needed, bias) - margin, np.maximum(needed, bias) + margin))
        return np.stack(
            (np.min([a for _, a, _ in self._needed], axis=0), np.max([b for _, _, b in self._needed], axis=0))
        )

    def _answer(self, dt_s: float, position_rad: Array, setpoint_rad: Array) -> Array:
        """(J,) acceleration once the drives have answered a setpoint for so long.

        They oscillate about it, damped: with a = ω / √2 the distance is  e^-at (c cos at + d sin at).
        """
        omega = 2.0 * math.pi * self._config.drive_hz
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
        mujoco.mj_mulM(model, data, self._inertial, acceleration_rad_s2 @ rates)
        return rates @ self._inertial, rates @ self._bias
