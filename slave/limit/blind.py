"""How far each hand would go if the line died now, and the speed that keeps this within a limit. Pure.

After the last command the tracker goes on by its own law until the guard decides, one step after
`command_timeout_s`; then every joint brakes as hard as it may. Both are known beforehand: the tracker's
targets for the time to come are asked for, and the limiter's law is followed in larger steps. The way counts
from where the encoders are, since the servos have yet to follow what was written to them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.guard.limits import MotionLimits
from slave.guard.zones import Zone
from slave.limit.limit import approach
from slave.model.ends import limb_ends

Targets = Callable[[int], tuple[Array, Array] | None]
"""Position and velocity, (J,) each, that the tracker would ask for at a time, ns; None: nowhere."""
STEP_S = 0.01
"""The limiter's law is followed in steps of about this."""
POSE_EVERY = 2
"""And the hands are looked at after so many of them."""
BRAKING_POSES = 4
SHARE, PLUS_M = 0.08, 0.003
"""Added for what the servos overshoot and encoders round."""
SERVO_LAG_S = 0.05
"""At most: how far the servos are behind, for the speed limit."""


@dataclass(frozen=True, slots=True)
class BlindWay:
    """If the line died now."""

    way_m: Array
    """(E,) each end would be so far away at most, until all stand."""
    after_s: float
    """Until all stand."""


@dataclass(frozen=True, slots=True)
class Course:
    """What the setpoint does now; (J,) each."""

    position_rad: Array
    velocity_rad_s: Array
    held: Mask
    max_velocity_rad_s: Array
    max_acceleration_rad_s2: Array


class BlindDistance:
    """Foretells the way, and slows the setpoint where the robot or a zone has a `max_blind_cm`."""

    def __init__(
        self,
        skeleton: Skeleton,
        limits: MotionLimits,
        most_cm: float | None = None,
        period_s: float = 0.005,
        zones: Sequence[Zone] = (),
    ) -> None:
        """`most_cm`: `[guard] max_blind_cm`; `period_s`: of the servo loop. Zones may allow less."""
        self.ends = limb_ends(skeleton)
        self._limits = limits
        self._period_s = period_s
        self._decides_s = 0.0
        self._most_m = math.inf if most_cm is None else most_cm / 100.0
        self._zones = [(zone, zone.max_blind_cm / 100.0) for zone in zones if zone.max_blind_cm is not None]
        self._brake_s = float((limits.max_velocity_rad_s / limits.max_acceleration_rad_s2).max())
        self._blind_s = math.inf
        self._heard_ns: int | None = None
        self.newest: BlindWay | None = None
        """As of the newest command; None while the robot follows nobody."""

    def heard(self, received_ns: int) -> None:
        """A command was accepted: what follows from it is foretold in the next step."""
        self._heard_ns = received_ns

    def look(self, now_ns: int, measured_rad: Array, course: Course, target: Targets) -> None:
        """Foretell the way from where the joints are (J,), if a command was accepted since the last look."""
        if self._heard_ns is None:
            return
        left_s = self._decides_s - to_s(now_ns - self._heard_ns)
        self._heard_ns = None
        self.foretell(now_ns, max(left_s, self._period_s), measured_rad, course, target)

    def foretell(
        self,
        now_ns: int,
        decides_s: float,
        measured_rad: Array,
        course: Course,
        target: Targets,
    ) -> None:
        """The way from the encoders (J,), if the guard hears nothing and decides `decides_s` from now."""
        steps = max(1, math.ceil(decides_s / STEP_S))
        step_s = decides_s / steps
        position, velocity = course.position_rad, course.velocity_rad_s
        poses = [position]
        for step in range(1, steps + 1):
            aim = target(now_ns + to_ns(step * step_s))
            if aim is not None:
                position, velocity = self._follow(position, velocity, aim, course, step_s)
            if step % POSE_EVERY == 0:
                poses.append(position)
        brake = self._limits.max_acceleration_rad_s2
        each_s = np.abs(velocity) / brake
        brake_s = float(each_s.max())
        for share in np.linspace(0.0, 1.0, BRAKING_POSES + 1)[1:]:
            within_s = np.minimum(share * brake_s, each_s)
            poses.append(position + velocity * within_s - 0.5 * np.sign(velocity) * brake * within_s**2)
        begin_m = self.ends.at(measured_rad)
        way_m = np.max([np.linalg.norm(self.ends.at(pose) - begin_m, axis=1) for pose in poses], axis=0)
        self.newest = BlindWay(way_m * (1.0 + SHARE) + PLUS_M, decides_s + brake_s)

    def _follow(
        self, position: Array, velocity: Array, aim: tuple[Array, Array], course: Course, step_s: float
    ) -> tuple[Array, Array]:
        goal = self._limits.reachable(aim[0])
        goal_rad_s = np.where(goal != aim[0], 0.0, aim[1])
        error = goal - position - goal_rad_s * step_s
        wish = np.where(
            course.held, 0.0, goal_rad_s + approach(error, goal_rad_s, course.max_acceleration_rad_s2, step_s)
        )
        wish = self.slowed(position, wish, step_s)
        most, gain = course.max_velocity_rad_s, self._limits.max_acceleration_rad_s2 * step_s
        moved = np.clip(np.clip(wish, -most, most), velocity - gain, velocity + gain)
        return position + moved * step_s, moved

    @property
    def way_m(self) -> tuple[float, ...]:
        """Of `newest`; () where there is none."""
        return () if self.newest is None else tuple(self.newest.way_m.round(4).tolist())

    @property
    def after_s(self) -> float:
        """Of `newest`; 0 where there is none."""
        return 0.0 if self.newest is None else round(self.newest.after_s, 4)

    def forget(self) -> None:
        """The robot follows nobody."""
        self.newest = None

    def allow(self, timeout_s: float) -> None:
        """Take the guard's time-out: it decides one step after it. How fast an end may be follows.

        With v the end's speed: v (lag + decides) until then, v t / 2 while the joints brake for t.
        """
        self._decides_s = timeout_s + self._period_s
        self._blind_s = SERVO_LAG_S + self._decides_s + 0.5 * self._brake_s

    def _most_m_s(self, end_m: Array) -> Array:
        """(E,) how fast ends at (E, 3) may be. From outside, an end may go as far as into a zone, and on."""
        most_m = np.full(len(end_m), self._most_m)
        for zone, inside_m in self._zones:
            outside_m = np.maximum(zone.distance_m(end_m) - max(zone.margin_m, 0.0), 0.0)
            np.minimum(most_m, inside_m + outside_m, out=most_m)
        out: Array = np.maximum((most_m - PLUS_M) / (1.0 + SHARE), 0.0) / self._blind_s
        return out

    def slowed(self, position_rad: Array, wish_rad_s: Array, step_s: float) -> Array:
        """The wish (J,), slowed so that no end is faster than allowed.

        All joints of a limb are slowed alike, so that its hand keeps its way.
        """
        if (math.isinf(self._most_m) and not self._zones) or step_s <= 0.0:
            return wish_rad_s
        end_m = self.ends.at(position_rad)
        way_m = self.ends.at(position_rad + wish_rad_s * step_s) - end_m
        speed_m_s = np.linalg.norm(way_m, axis=1) / step_s
        share = np.minimum(1.0, self._most_m_s(end_m) / np.maximum(speed_m_s, 1e-9))
        slowest = np.where(self.ends.moved_by, share[:, None], 1.0).min(axis=0)
        out: Array = wish_rad_s * slowest
        return out
