"""The simulated robot as drives and encoders see it, on any clock: no thread, no sleep, deterministic."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.model.build import STEP_S, build_model, unit_rates
from slave.model.own import leader
from slave.servos.mujoco.effort import MotorTorque
from slave.servos.servos import EncoderReading, check_setpoint, check_torque_limit

STEPS_PER_CYCLE = 1
CYCLE_NS = STEPS_PER_CYCLE * to_ns(STEP_S)
"""The drives' cycle, 4 ms: setpoints are taken in and encoders latched at its boundaries."""
MOST_CYCLES = 5
"""Late by more than these 20 ms, the robot skips rather than catches up in a burst."""


class SimulatedRobot:
    """Physics of one robot up to some time of its own, which `advance` moves on.

    A setpoint written during a cycle takes effect at the cycle's end, as on a field bus that is
    synchronised. The drives hold the last setpoint for as long as no other comes.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        encoders: EncoderConfig | None = None,
        origin_ns: int = 0,
        position_rad: Array | None = None,
    ) -> None:
        """At rest at `origin_ns` in `position_rad` (J,), or as near the zero pose as limits let it be."""
        self._skeleton = skeleton
        self._encoders = Encoders(skeleton, encoders)
        self._model = build_model(skeleton)
        self._data = mujoco.MjData(self._model)
        self._at_end = mujoco.MjData(self._model)
        """What is computed of the newest state without disturbing it."""
        if position_rad is None:
            position_rad = skeleton.zero_rad
        self._setpoint = np.clip(position_rad, skeleton.lower_rad, skeleton.upper_rad)
        # views of the simulation's own state: fetched once, as every access builds a new one
        self._hinge_rad, self._taken_in = self._data.qpos, self._data.ctrl
        self._hinge_rad[:] = self._setpoint @ unit_rates(skeleton, self._model)
        self._taken_in[:] = self._setpoint
        leaders = [leader(joint) for joint in skeleton.joints]
        self._leaders = np.array([self._model.joint(angle).qposadr[0] for angle, _ in leaders])
        self._joint_per_hinge = np.array([1.0 / ratio for _, ratio in leaders])
        self._torque = MotorTorque(skeleton, self._model, self._data)
        self._torque_nm: Array | None = None
        self._all_valid = np.ones(len(leaders), dtype=np.bool_)
        self.now_ns = origin_ns
        """Time that the physics has reached."""
        self.skipped_cycles = 0
        """Cycles that were left out because `advance` came too late for them."""

    def write(self, position_rad: Array) -> None:
        """New setpoints (J,), kept within the drives' limits. Raises ValueError if not finite or not J."""
        check_setpoint(position_rad, len(self._setpoint))
        self._setpoint = np.clip(position_rad, self._skeleton.lower_rad, self._skeleton.upper_rad)

    def limit_torque(self, torque_nm: Array | None) -> None:
        """See `LimitsTorque`; taken in at the cycle's end, with the setpoint."""
        check_torque_limit(torque_nm, len(self._setpoint))
        self._torque_nm = torque_nm

    def resume(self, now_ns: int) -> None:
        """Go on from `now_ns` after a pause that the robot's physics skips."""
        self.now_ns = now_ns

    def advance(self, until_ns: int) -> None:
        """Run every cycle that ends by `until_ns`; skip what lies more than MOST_CYCLES back."""
        due = (until_ns - self.now_ns) // CYCLE_NS
        if due > MOST_CYCLES:
            self.skipped_cycles += due - MOST_CYCLES
            self.now_ns += (due - MOST_CYCLES) * CYCLE_NS
            due = MOST_CYCLES
        for _ in range(due):
            self._torque.before()
            mujoco.mj_step(self._model, self._data, nstep=STEPS_PER_CYCLE)
            self._torque.after()
            self._take_in()
            self.now_ns += CYCLE_NS

    def _take_in(self) -> None:
        """At a cycle's end the drives take in what was written last."""
        self._taken_in[:] = self._setpoint
        self._torque.limit(self._torque_nm)

    def read(self) -> EncoderReading:
        """The counts latched at the end of the last cycle; none valid where the physics has diverged."""
        position = self.position_rad
        # one sum finds any NaN or infinity
        if not math.isfinite(position.sum()):
            return EncoderReading(self.now_ns, np.zeros(len(position), np.int64), ~self._all_valid)
        counts = self._encoders.counts(position)
        return EncoderReading(self.now_ns, counts, self._all_valid, effort_nm=self.effort_nm)

    @property
    def velocity_rad_s(self) -> Array:
        """(J,) at the end of the newest cycle."""
        out: Array = self._data.qvel[self._leaders] * self._joint_per_hinge
        return out

    def rate_rad_s(self, link: str) -> Array:
        """(3,) angular velocity of a body, in its own frame, half a cycle before the end of the newest one.

        The step is semi-implicit: positions go on by the rates of its end, which so are the cycle's mean.
        """
        model, at_end, out = self._model, self._at_end, np.zeros(6)
        # a step ends with positions and rates, but leaves the bodies' velocities of its beginning
        at_end.qpos[:], at_end.qvel[:] = self._data.qpos, self._data.qvel
        mujoco.mj_kinematics(model, at_end)
        mujoco.mj_comPos(model, at_end)
        mujoco.mj_comVel(model, at_end)
        mujoco.mj_objectVelocity(model, at_end, mujoco.mjtObj.mjOBJ_BODY, model.body(link).id, out, 1)
        return out[:3]

    @property
    def effort_nm(self) -> Array:
        """(J,) torque of each motor at its joint in the newest cycle."""
        return self._torque.joint_nm

    @property
    def position_rad(self) -> Array:
        """True joint angles (J,), which no encoder shows as finely."""
        out: Array = self._hinge_rad[self._leaders] * self._joint_per_hinge
        return out
