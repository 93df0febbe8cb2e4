"""The simulated robot with a patient in its way, in fine steps; its masses may differ from the model's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from common.clock import NS_PER_S
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.patient.patient import SoftPatient
from slave.encoders.counts import EncoderConfig
from slave.model.build import unit_rates
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot
from slave.servos.servos import EncoderReading

STEPS = 8
"""Physics steps of 0.5 ms in a cycle of the drives: 60 to the contact's period."""

LOADED = "right_hand"
"""The segment that carries `Imperfect.payload_kg`."""
_DRAWN = 256
"""So many readings' noise is drawn at once, which is faster."""


@dataclass(frozen=True, slots=True)
class Imperfect:
    """How the robot differs from its own model, and its drives' torques from the truth."""

    mass_share: float = 0.0
    """Standard deviation of each segment's mass and inertia."""
    payload_kg: float = 0.0
    """At `LOADED`, on top."""
    noise_share: float = 0.005
    """Standard deviation of the torques told, share of each motor's limit: its current's noise."""
    step_share: float = 0.001
    """Their steps: CiA 402 tells per mille."""
    late_cycles: int = 1
    """Cycles by which a torque is older than the angle beside it."""
    drive_bits: int = 0
    """Of a turn at the joint's output, of the drives' own encoders; 0: they tell no angles."""
    cycles_a_reading: int = 1
    """Drives on CANopen are read at each SYNC, every fifth cycle, and tell the mean torque since the last."""
    stamp_error_s: float = 0.0
    """All angles of a reading are taken so much before or after its stamp, at most; even in between."""
    seed: int = 1


PERFECT = Imperfect(noise_share=0.0, step_share=0.0, late_cycles=0)


class TouchingRobot(SimulatedRobot):
    """A robot of which one point, on `segment` at `local_m` (3,) in its frame, may touch a patient."""

    def __init__(
        self,
        skeleton: Skeleton,
        imperfect: Imperfect,
        *,
        steps: int = STEPS,
        encoders: EncoderConfig | None = None,
        origin_ns: int = 0,
    ) -> None:
        super().__init__(skeleton, encoders, origin_ns)
        self._steps = steps
        self._imperfect = imperfect
        self._random = np.random.default_rng(imperfect.seed)
        self._model.opt.timestep /= steps
        self._spoil()
        self.patient: SoftPatient | None = None
        self.segment, self.local_m = "right_hand", np.zeros(3)
        self._told = np.zeros(len(skeleton.joints))
        self._given_nm: list[Array] = []
        """Of each cycle that is not yet told."""
        self._cycles = 0
        limits = self._model.jnt_actfrcrange[self._model.dof_jntid[self._leaders], 1]
        self._rates = unit_rates(skeleton, self._model)
        self._limit_nm = limits / np.abs(self._joint_per_hinge)
        self.forces_n: list[float] = []
        """On the patient, one a physics step."""
        self._noise: Iterator[Array] = iter(())
        self._newest = self._reading()

    def _spoil(self) -> None:
        model, wrong = self._model, self._imperfect
        factors = 1.0 + wrong.mass_share * self._random.standard_normal(model.nbody)
        model.body_mass[:] *= factors
        model.body_inertia[:] *= factors[:, None]
        if wrong.payload_kg:
            self.load(LOADED, wrong.payload_kg)

    def load(self, segment: str, mass_kg: float) -> None:
        """A segment carries so much more, at its own centre."""
        self._model.body_mass[self._model.body(segment).id] += mass_kg

    def advance(self, until_ns: int) -> None:
        """Run every cycle that ends by `until_ns`; none is ever skipped."""
        each = self._imperfect.cycles_a_reading
        while self.now_ns + CYCLE_NS <= until_ns:
            given = np.zeros_like(self._limit_nm)
            for _ in range(self._steps):
                self._touch()
                self._torque.before()
                mujoco.mj_step(self._model, self._data)
                self._torque.after()
                given += self._torque.joint_nm
            self._take_in()
            self.now_ns += CYCLE_NS
            self._given_nm.append(self._measured(given / self._steps))
            self._cycles += 1
            if each > 1 and self._cycles % each == 0:
                self._newest = self._reading()

    def read(self) -> EncoderReading:
        """The counts of the last cycle, or of the last SYNC, and torques as a drive tells them."""
        if self._imperfect.cycles_a_reading == 1 and self.now_ns != self._newest.read_ns:
            self._newest = self._reading()
        return self._newest

    def _reading(self) -> EncoderReading:
        wrong, position_rad, drive_rad = self._imperfect, self.position_rad, None
        if wrong.stamp_error_s:
            position_rad += self.velocity_rad_s * self._random.uniform(-1.0, 1.0) * wrong.stamp_error_s
        if wrong.drive_bits:
            step = 2.0 * np.pi / (1 << wrong.drive_bits)
            drive_rad = np.rint(position_rad / step) * step
        return EncoderReading(
            self.now_ns, self._encoders.counts(position_rad), self._all_valid, drive_rad, self._told_nm(),
            round(wrong.stamp_error_s * NS_PER_S),
        )  # fmt: skip

    def _told_nm(self) -> Array:
        """(J,) mean of the torques since the last reading, or of as many cycles before."""
        kept, late = self._given_nm, self._imperfect.late_cycles
        if len(kept) > late:
            told: Array = np.mean(kept[: len(kept) - late], axis=0)
            self._given_nm = kept[len(kept) - late :]
            self._told = told
        return self._told

    def point(self) -> tuple[Array, Array]:
        """Place and velocity (3,) of the point that may touch, base frame."""
        model, data = self._model, self._data
        body = model.body(self.segment).id
        place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self.local_m
        turning, moving = np.split(self._twist(body), 2)
        velocity: Array = moving + np.cross(turning, place - data.xpos[body])
        return place, velocity

    def torques_of(self, direction: Array) -> Array:
        """(J,) joint torques, N m, of a force of 1 N at that point in a direction (3,)."""
        jacobian = np.empty((3, self._model.nv))
        body = self._model.body(self.segment).id
        mujoco.mj_jac(self._model, self._data, jacobian, None, self.point()[0], body)
        return np.asarray(self._rates @ (jacobian.T @ direction))

    def _twist(self, body: int) -> Array:
        out = np.empty(6)
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_XBODY, body, out, 0)
        return out

    def _touch(self) -> None:
        if self.patient is None:
            return
        data, body = self._data, self._model.body(self.segment).id
        place, velocity = self.point()
        force = self.patient.push(place, velocity, self._model.opt.timestep)
        data.xfrc_applied[body, :3] = force
        data.xfrc_applied[body, 3:] = np.cross(place - data.xipos[body], force)
        self.forces_n.append(self.patient.force_n)

    def _measured(self, given_nm: Array) -> Array:
        wrong = self._imperfect
        if (noise := next(self._noise, None)) is None:
            self._noise = iter(self._random.standard_normal((_DRAWN, len(given_nm))))
            noise = next(self._noise)
        step = wrong.step_share * self._limit_nm
        told: Array = given_nm + wrong.noise_share * self._limit_nm * noise
        return np.rint(told / step) * step if wrong.step_share else told
