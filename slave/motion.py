"""Where the setpoint goes: nearest posture ▸ track ▸ limit, as far as the guard permits.

An accepted command comes in by `accept`; `step` moves the setpoint once a tick. It also foretells how far the
hands would go if the line died now, and yields to who touches the robot. The guard is told of clamps and
losses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from common.clock import to_s
from common.clock_sync import Offset
from common.quaternion import Array
from common.wire.messages import Command, Mask
from slave.config import SlaveConfig
from slave.contact.reflex import ContactReflex
from slave.contact.torque_limit import TorqueLimit
from slave.contact.watch import ContactWatch
from slave.guard import Guard, Permission
from slave.guard.states import State
from slave.limit.blind import BlindDistance, Course
from slave.limit.damper import DistanceDamper
from slave.limit.limit import Setpoint, SetpointLimiter
from slave.limit.nearest import NearestPosture
from slave.limit.pace import Pace
from slave.track import Tracker, TrackTarget
from slave.track.config import make_tracker


class RobotMotion:
    """Tracker and limits between ticks."""

    def __init__(self, config: SlaveConfig, contact: ContactWatch, tracker: Tracker | None = None) -> None:
        """`tracker`: another than configured."""
        skeleton = config.skeleton
        self._contact = contact
        limits = config.guard.limits(skeleton)
        self.nearest = NearestPosture(skeleton, limits)
        self.tracker = tracker or make_tracker(config.track, config.servos.bus_lag_s)
        self.pace = Pace(limits, config.guard)
        self.damper = DistanceDamper(skeleton, config.guard.self_margin_cm, config.guard.zones)
        self.limiter = SetpointLimiter(skeleton.joint_names, limits, self.damper)
        self.reflex = ContactReflex(config.contact, contact, skeleton.joint_names)
        self.torque_limit = TorqueLimit(config.contact)
        self.blind = BlindDistance(
            skeleton, limits, config.guard.max_blind_cm, 1.0 / config.loop.rate_hz, config.guard.zones
        )
        self.limiter.slowed = self.blind.slowed
        self.target: TrackTarget | None = None
        """Where the tracker saw the operator at the newest tick; None while the robot follows nobody."""
        self._clamped: Mask = np.zeros(len(skeleton.joints), np.bool_)
        self._episode = 0
        """The guard's episode when the tracker was reset last."""

    def take_clamped(self) -> Mask:
        """(J,) joints that a limit held back since this was asked last."""
        clamped, self._clamped = self._clamped, np.zeros_like(self._clamped)
        return clamped

    def accept(self, guard: Guard, command: Command, received_ns: int, now_ns: int, offset: Offset) -> None:
        """Take a command that the guard accepted: nearest posture within the site's limits ▸ tracker."""
        self._begin_anew(guard, now_ns)
        asked = command.position_rad
        # by the master's own stamps: what is thought of its clock may step
        position_rad, velocity_rad_s = self.nearest.of(
            command.stamps.sampled_ns, asked, command.velocity_rad_s, command.valid
        )
        guard.clamped(self.nearest.clamps(now_ns, asked, position_rad))
        self.blind.heard(received_ns)
        sampled_ns = offset.local_ns(command.stamps.sampled_ns)
        self.tracker.accept(sampled_ns, now_ns, position_rad, velocity_rad_s)

    def step(self, guard: Guard, now_ns: int, permission: Permission) -> Setpoint | None:
        """Where the setpoint goes in this turn of the loop; None while not every joint is seated."""
        self._begin_anew(guard, now_ns)
        self.target = None
        if permission.seat_rad is not None:
            self.limiter.seat(permission.seat_rad)
            self._contact.moved()
        if not permission.ready:
            return None
        target = self.target = self._track(guard, now_ns, permission)
        if target is None:
            self.blind.forget()
            # to stop and to hold takes what it takes
            self.torque_limit.forget()
            self._stop(guard, now_ns, permission)
        else:
            self._limit(guard, now_ns, permission, target)
            self.reflex.followed(now_ns, guard.stand_rad)
        setpoint = self.limiter.setpoint
        foretold = self._contact.wrote(permission.dt_s, guard.stand_rad, setpoint.position_rad)
        if target is not None:
            torque_nm = self.torque_limit.step(permission.dt_s, *foretold, self._contact.limit_floor_nm)
            setpoint = replace(setpoint, torque_nm=torque_nm)
        return setpoint

    def _track(self, guard: Guard, now_ns: int, permission: Permission) -> TrackTarget | None:
        """Where the operator is now; None: nowhere that the robot may go."""
        target = self.tracker.target(now_ns) if permission.moving else None
        if target is not None and not target.finite:
            guard.lose(now_ns, "target", "the tracker's target is not finite")
            return None
        return target

    def _stop(self, guard: Guard, now_ns: int, permission: Permission) -> None:
        """Brake as hard as the joints may, or yield to who touches the robot."""
        if permission.state is State.ESTOP or not guard.may_yield(now_ns):
            self.reflex.cancel()
        elif permission.state is State.HOLD and self.reflex.step(
            now_ns, permission.dt_s, guard.stand_rad, self.limiter, guard.doubted
        ):
            return
        self.limiter.stop(permission.dt_s)

    def _limit(self, guard: Guard, now_ns: int, permission: Permission, target: TrackTarget) -> None:
        """Move the setpoint towards the target, as far and as fast as each joint may in this step.

        After a command, foretell how far that would lead if no more came.
        """
        error_rad = self.limiter.limits.reachable(target.position_rad) - self.limiter.position_rad
        if permission.state is State.ALIGN:
            most = self.pace.aligning(now_ns, error_rad, permission.free)
        else:
            most = self.pace.tracking(now_ns, error_rad, permission.free, self.damper.held_back)
        self.blind.allow(to_s(guard.times.command_timeout_ns))
        clamps = self.limiter.step(
            now_ns, permission.dt_s, target.position_rad, target.velocity_rad_s, ~permission.free, *most
        )
        guard.clamped(clamps)
        self._clamped |= self.limiter.clamped | self.nearest.moved
        course = Course(self.limiter.position_rad, self.limiter.velocity_rad_s, ~permission.free, *most)
        self.blind.look(now_ns, guard.stand_rad, course, self._looked_up)
        if self.damper.overdue:
            guard.lose(now_ns, "distance", self.damper.overdue)
        # a joint that is held back is as near to the operator as it can come
        guard.approached(now_ns, np.where(self.damper.held_back, 0.0, error_rad))

    def _looked_up(self, at_ns: int) -> tuple[Array, Array] | None:
        target = self.tracker.target(at_ns)
        return None if target is None else (target.position_rad, target.velocity_rad_s)

    def _begin_anew(self, guard: Guard, now_ns: int) -> None:
        """After a loss, a stop or an engage: what the operator did before must not move the robot."""
        if self._episode != guard.episode:
            self._episode = guard.episode
            self.pace.begin(now_ns)
            self.tracker.reset()
            self.nearest.forget()
