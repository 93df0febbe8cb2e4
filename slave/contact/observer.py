"""The torque from outside at each joint, by a generalised-momentum observer (De Luca and Mattone 2005)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.contact.stamps import SETTLED, StampNoise
from slave.model.build import build_model, unit_rates

ROWS = 8
"""What passes the poles: the residual, two ways to tell the model's part, torques' rise, fall and jumps, and
what pushes a joint up from its lower end stop or down from its upper one."""
AT_STOP_RAD = 0.003
"""Two counts of an output encoder. A joint that is so far beyond its limit presses into its end stop."""
HITS_RAD_S, REBOUNDS_S = 0.5, 0.1
"""One that comes to its limit faster than this hits the stop, however rigid that is, and leans on it for a
while. The speed is more than one count that flickers: a joint that rests at its limit hits nothing."""
SUDDEN = 2.0 * 0.27
"""Peak of s / (1 + s T)³ for a unit step, times T, and as much again: no drive is just as its model says."""
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
        self,
        skeleton: Skeleton,
        time_constants_s: Sequence[float],
        model: mujoco.MjModel | None = None,
        effort_late_s: float = 0.0,
    ) -> None:
        """`time_constants_s` (T,): each 1/K, ascending. `model`: the robot's; None: that of the skeleton.

        Motor torques may be `effort_late_s` older than the angles beside them.
        """
        self._late_s = effort_late_s
        self.model = build_model(skeleton) if model is None else model
        self.data = mujoco.MjData(self.model)
        # fetched once, as every access builds a new view
        self._hinge_rad, self._hinge_rad_s = self.data.qpos, self.data.qvel
        self.rates: Array = unit_rates(skeleton, self.model)
        """(J, hinges)"""
        self._time_constants_s = tuple(time_constants_s)
        self._by_constant = np.array(time_constants_s)[:, None, None]
        self._inertial, self._bias = np.empty(self.model.nv), np.empty(self.model.nv)
        self._inertia = np.empty((self.model.nv, self.model.nv))
        self._joint_rates = np.abs(self.rates)
        self._limits_rad = np.stack((-skeleton.lower_rad, skeleton.upper_rad))
        self.restart()

    def restart(self) -> None:
        """Forget what was: nothing is known of the motion."""
        joints = len(self.rates)
        self._read_ns: int | None = None
        self._step_s = 0.0
        self._known_s = 0.0
        self._position_rad, self._velocity_rad_s, self._effort_nm = np.zeros((3, joints))
        self._poles = np.zeros((3, len(self._time_constants_s), ROWS, joints))
        self._value = np.zeros((ROWS, joints))
        self._at_stop: list[Mask] = []
        """(2, J) which joints were at their lower, upper end stops, in the last readings."""
        self._since_hit_s = np.full((2, joints), np.inf)
        self._unheard = False
        """Whether a torque was not known in the last reading."""
        self._stamps: list[StampNoise] = []
        """By time constant; none while all stamps are exact."""

    @property
    def ready(self) -> bool:
        """Whether no estimate depends any more on how it began."""
        return self.settled == len(self._time_constants_s)

    @property
    def settled(self) -> int:
        """Of how many time constants that is so: the shortest ones come first."""
        return sum(self._known_s > SETTLED * each for each in self._time_constants_s)

    @property
    def residuals_nm(self) -> Array:
        """(T, J) the residual r by time constant, positive where it is pushed in a joint's direction."""
        out: Array = self._poles[2, :, 0]
        return out

    @property
    def external_nm(self) -> Array:
        """(J,) the residual of the shortest time constant."""
        out: Array = self._poles[2, 0, 0]
        return out

    @property
    def model_nm(self) -> Array:
        """(T, J) what an error of the model would be a share of, after the same poles.

        |M q̈| + |C q̇ + g|, where |M q̈| = |τ - C q̇ - g| as long as nothing pushes: of both the lesser counts.
        A robot that is brought to a stop by somebody is slowed by no torque of its motors.
        """
        out: Array = np.minimum(self._poles[2, :, 1], self._poles[2, :, 2])
        return out

    @property
    def late_nm(self) -> Array:
        """(T, J) what torques that come late feign at most, in the residual's direction.

        A torque that rises is told too small, which feigns a push in its direction, and none against it.
        A jump by Δ that is told L late feigns at most the pulse's answer, 0.27 Δ L / T.
        """
        seen = self._poles[2]
        signed_nm = self._late_s * np.where(seen[:, 0] < 0.0, seen[:, 4], seen[:, 3])
        jumps_nm = SUDDEN * self._late_s / self._by_constant[:, 0] * seen[:, 5]
        return np.asarray(np.maximum(signed_nm, jumps_nm))

    @property
    def stop_nm(self) -> Array:
        """(T, J) what the joints' own end stops have pushed, in the residual's direction.

        A joint that runs into its stop is pushed back by that, as by a person, but by a torque on this joint
        alone. Whoever pushes it the same way meanwhile is not noticed at this joint before it has left it.
        """
        seen = self._poles[2]
        out: Array = np.where(seen[:, 0] < 0.0, seen[:, 7], seen[:, 6])
        return out

    @property
    def stamp_nm(self) -> Array | float:
        """(T, J) what the errors of the readings' stamps can feign at most; 0 where stamps are exact."""
        return np.array([one.feigned_nm for one in self._stamps]) if self._stamps else 0.0

    def update(
        self,
        read_ns: int,
        position_rad: Array,
        effort_nm: Array,
        stamp_error_s: float = 0.0,
        sudden_nm: Array | float = 0.0,
    ) -> None:
        """Take angles and motor torques (J,) read at one time, ns; NaN torques make NaN residuals.

        The angles may have been taken `stamp_error_s` earlier or later. Torques may jump by `sudden_nm` (J,).
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
        self._at_stop = [*self._at_stop[-2:], self._stops(position_rad, velocity, step_s)]
        if self._step_s > 0.0:
            between_s = 0.5 * (self._step_s + step_s)
            effort_rate = (effort_nm - self._effort_nm) / step_s
            efforts = 0.5 * (self._effort_nm + effort_nm), effort_rate, sudden_nm
            self._advance(velocity, between_s, *efforts)
            self._doubt_stamp(step_s, stamp_error_s)
        self._position_rad, self._velocity_rad_s = position_rad, velocity
        self._effort_nm, self._step_s = effort_nm, step_s

    def _stops(self, position_rad: Array, velocity_rad_s: Array, step_s: float) -> Mask:
        """(2, J) which joints are at their lower, upper end stops, at (J,) and velocities (J,)."""
        outwards = np.array([[-1.0], [1.0]])
        beyond_rad = outwards * position_rad - self._limits_rad
        near = beyond_rad >= -AT_STOP_RAD
        hits = near & (outwards * velocity_rad_s > HITS_RAD_S)
        self._since_hit_s = np.where(hits, 0.0, self._since_hit_s + step_s)
        out: Mask = (beyond_rad > AT_STOP_RAD) | near & (self._since_hit_s <= REBOUNDS_S)
        return out

    def _advance(
        self,
        velocity_rad_s: Array,
        elapsed_s: float,
        effort_nm: Array,
        effort_rate_nm_s: Array,
        sudden_nm: Array | float,
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
        value[2] = np.abs(effort_nm - bias) + np.abs(bias)
        value[3] = np.maximum(effort_rate_nm_s, 0.0)
        value[4] = value[3] - effort_rate_nm_s
        value[5] = sudden_nm
        # a stop may have pushed at any time between the three readings that the residual is made of
        lower, upper = np.logical_or.reduce(self._at_stop)
        value[6] = np.where(lower, np.maximum(value[0], 0.0), 0.0)
        value[7] = np.where(upper, np.maximum(-value[0], 0.0), 0.0)
        unheard = math.isnan(value.sum())
        if unheard or self._unheard:
            # a joint that is heard again begins anew
            np.copyto(self._poles, 0.0, where=np.isnan(self._poles) & ~np.isnan(value))
        self._unheard = unheard
        share = -np.expm1(-elapsed_s / self._by_constant)
        for pole in self._poles:
            pole += share * (value - pole)
            value = pole
        self._known_s += elapsed_s

    def _doubt_stamp(self, step_s: float, error_s: float) -> None:
        """Note how wrong the newest stamp may be, beside the momentum that `_advance` has just worked out."""
        if not self._stamps:
            if not error_s:
                return
            self._stamps = [StampNoise(len(self.rates), each) for each in self._time_constants_s]
        model, data = self.model, self.data
        mujoco.mj_fullM(model, data, self._inertia)
        turning = np.abs(self._inertia) @ np.abs(self._hinge_rad_s)
        momentum = self._joint_rates @ turning
        for stamps in self._stamps:
            stamps.add(step_s, error_s, momentum)
