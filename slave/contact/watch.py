"""Whether the robot is pushed: each joint's external torque against its threshold, reading by reading."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import mujoco
import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.contact.config import ContactConfig
from slave.contact.foretold import ForetoldTorque
from slave.contact.least_push import least_push_n, push_words
from slave.contact.observer import MomentumObserver
from slave.contact.payload import loaded_model
from slave.contact.thresholds import angles_of, thresholds_nm
from slave.model.build import build_model
from slave.model.own import leader
from slave.servos.payload import PayloadConfig
from slave.servos.servos import EncoderReading

RELEASE = 0.6
"""Contact has ended once every torque is below this share of its threshold."""
JUMP_FACTOR, JUMP_SLACK_RAD = 2.0, 0.005
"""An angle that moves on faster than this times its joint's limit, plus three counts, is no motion."""
UNSETTLED_S = 0.5
"""An estimate that has not settled for so long is none."""


@cache
def _model(skeleton: Skeleton) -> mujoco.MjModel:
    return build_model(skeleton)


class ContactWatch:
    """Watches J joints. Give it each tick's reading; it takes each reading once."""

    def __init__(
        self,
        skeleton: Skeleton,
        config: ContactConfig,
        payload: Mapping[str, PayloadConfig] | None = None,
    ) -> None:
        """`payload`: what the robot carries, by segment."""
        self._model = model = loaded_model(skeleton, payload) if payload else _model(skeleton)
        self._config = config
        self._skeleton = skeleton
        self._foretold = ForetoldTorque(skeleton, config.drive_hz, model)
        self._tune(drives=False)
        self.limit_floor_nm: Array = self._floors_nm[0]
        """(J,) what `TorqueLimit` stands on: the output encoders' thresholds of what is sudden, even where
        drives tell finer angles. With less, drives reach their limits where nobody is touched (README.md)."""
        self.finding: str | None = None
        """Who is pushed and how hard, in words, for as long as it lasts; None: nobody."""
        self._also: str | None = None
        self.count = 0
        """Contacts since the start."""
        self.share: Array = np.zeros(len(self.floor_nm))
        """(J,) external torque over threshold, by the newest reading that told."""
        self._watched: Mask = np.isfinite(self.floor_nm)
        self._fastest_rad_s = JUMP_FACTOR * skeleton.max_velocity_rad_s
        self._told: Mask = np.zeros(len(self.floor_nm), np.bool_)
        self._position_rad: Array | None = None
        self._read_ns = 0
        self._ready_ns: int | None = None
        hinges = [model.joint(leader(joint)[0]) for joint in skeleton.joints]
        self._hinge_ids = np.array([hinge.id for hinge in hinges])
        self._depth = [_depth(model, int(hinge.bodyid[0])) for hinge in hinges]

    def _tune(self, *, drives: bool) -> None:
        """To the drives' own angles, or to the output encoders'."""
        angles = angles_of(self._config, drives=drives)
        self._by_drives = drives
        self.observer = MomentumObserver(
            self._skeleton, angles.time_constants_s, self._model, self._config.effort_late_s
        )
        self._floors_nm = thresholds_nm(self._skeleton, self._model, self._config, angles)
        """(T, J) by time constant."""
        self.floor_nm: Array = self._floors_nm.min(axis=0)
        """(J,) thresholds of a robot whose motors do nothing, for what lasts."""
        self.dull = push_words(least_push_n(self._skeleton, self.floor_nm), drives)
        """Below which force no push is noticed, in words."""

    @property
    def external_nm(self) -> Array | None:
        """(J,) external torque, NaN where it is not known; None where none is."""
        if not self.observer.ready or not self._told.any():
            return None
        return self.observer.external_nm.copy()

    @property
    def least_threshold_nm(self) -> Array:
        """(J,) thresholds now of what lasts."""
        out: Array = self._thresholds_nm.min(axis=0)
        return out

    @property
    def _thresholds_nm(self) -> Array:
        """(T, J) by time constant."""
        seen, config = self.observer, self._config
        out: Array = self._floors_nm + config.model_error * seen.model_nm + seen.late_nm + seen.stamp_nm
        out += seen.stop_nm
        return out

    @property
    def threshold_nm(self) -> Array:
        """(J,) thresholds of `external_nm` now: the more torque motion takes and changes, the higher."""
        out: Array = self._thresholds_nm[0]
        return out

    def moved(self) -> None:
        """The robot has been seated somewhere else: what was foretold is over."""
        self._foretold.forget()

    def missing(self, now_ns: int) -> str:
        """Which joints' contact is not noticed now, and why; empty where all that matter are watched."""
        deaf = self._watched & ~self._told
        if deaf.any():
            names = ", ".join(self._skeleton.joint_names[j] for j in np.flatnonzero(deaf))
            where = "" if deaf.sum() == self._watched.sum() else f" at {names}"
            return f"no contact detection{where}: the drives tell no torque"
        if self._watched.any() and (self._ready_ns is None or to_s(now_ns - self._ready_ns) > UNSETTLED_S):
            return "no contact detection: readings come too late or leap"
        return ""

    def fault(self, now_ns: int) -> str | None:
        """Why the robot may not move, for `Body.contact`: it is pushed, or contact would not be noticed."""
        if self.finding is not None:
            return self.finding
        return (self.missing(now_ns) or None) if self._config.required else None

    def look(self, now_ns: int, reading: EncoderReading, position_rad: Array) -> None:
        """Take a reading, and its joint angles (J,)."""
        if reading.read_ns == self._read_ns:
            return
        joints = len(position_rad)
        effort = np.full(joints, np.nan) if reading.effort_nm is None else reading.effort_nm
        self._told = ~np.isnan(effort)
        if not reading.valid.all() or self._leaps(reading.read_ns, position_rad):
            return  # a reading left out; the observer begins anew when too many are
        self._read_ns, self._position_rad = reading.read_ns, position_rad
        # in a mixture some joints have no drive's own angle: all are then watched by the output encoders'
        by_drives = reading.drive_rad is not None and not np.isnan(reading.drive_rad).any()
        if by_drives != self._by_drives:
            self._tune(drives=by_drives)
        angle_rad = reading.drive_rad if by_drives and reading.drive_rad is not None else position_rad
        self.observer.update(
            reading.read_ns, angle_rad, effort, to_s(reading.stamp_error_ns), self._foretold.sudden_nm
        )
        settled = self.observer.settled
        if not settled:
            return
        # a hard push is noticed before the longer time constants have settled
        shares = (np.abs(self.observer.residuals_nm) / self._thresholds_nm)[:settled]
        # what is no number exceeds no threshold: that is no detection
        ready = self.observer.ready and bool(np.isfinite(shares[:, self._told]).all())
        if ready:
            self._ready_ns = now_ns
        self.share = share = np.where(self._told, shares.max(axis=0), 0.0)
        pushed = share > 1.0
        if pushed.any():
            self.count += self.finding is None
            self.finding = self._describe(pushed)
        elif self.finding is not None and ready and (share < RELEASE).all():
            self.finding = None

    def wrote(self, dt_s: float, stand_rad: Array, setpoint_rad: Array) -> tuple[Array, Array]:
        """Note the setpoints (J,) that are written now: the drives will give torques for them.

        Returns M q'' and C q' + g (J,), N m at the joint, as they are foretold. `stand_rad` (J,): where the
        joints are, when it begins.
        """
        return self._foretold.step(dt_s, stand_rad, setpoint_rad)

    def also(self, finding: str | None) -> None:
        """Something else says that the robot is pushed, after a look: a zone's force limit."""
        if finding is not None and self.finding is None:
            self.count += self._also is None
            self.finding = finding
        self._also = finding

    def _leaps(self, read_ns: int, position_rad: Array) -> bool:
        before = self._position_rad
        since_s = to_s(read_ns - self._read_ns)
        # after a while it counts as where the joints are: the observer begins anew there
        if before is None or not 0.0 < since_s < UNSETTLED_S:
            return False
        return bool((np.abs(position_rad - before) > self._fastest_rad_s * since_s + JUMP_SLACK_RAD).any())

    def _describe(self, pushed: Mask) -> str:
        """The outermost joint that is pushed, its torque, and the least force that makes it."""
        j = max(np.flatnonzero(pushed).tolist(), key=lambda joint: self._depth[joint])
        joint = self._skeleton.joints[j]
        torque_nm = float(np.abs(self.observer.residuals_nm[: self.observer.settled, j]).max())
        model = self.observer.model
        segment = model.body(model.jnt_bodyid[self._hinge_ids[j]]).name
        force_n = torque_nm / self._lever_m(int(self._hinge_ids[j]))
        return f"pushed at {segment} or beyond: {torque_nm:.3g} N m at {joint.name}, at least {force_n:.0f} N"

    def _lever_m(self, hinge: int) -> float:
        """Greatest distance of what a hinge carries from its axis, at least a hand's width."""
        model, data = self.observer.model, self.observer.data
        body = model.jnt_bodyid[hinge]
        carried = [b for b in range(model.nbody) if _carries(model, body, b)]
        away = data.xipos[carried] - data.xanchor[hinge]
        return max(0.1, float(np.linalg.norm(np.cross(away, data.xaxis[hinge]), axis=1).max()))


def _depth(model: mujoco.MjModel, body: int) -> int:
    return 0 if body == 0 else 1 + _depth(model, int(model.body_parentid[body]))


def _carries(model: mujoco.MjModel, body: int, other: int) -> bool:
    while other > body:
        other = int(model.body_parentid[other])
    return other == body
