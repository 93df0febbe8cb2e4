"""Per-joint limits on the setpoint: it may ask for anything, and is given what the joint can safely do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from slave.encoders.counts import RAD_PER_COUNT
from slave.guard.events import Clamp, Rule
from slave.guard.limits import MotionLimits
from slave.limit.damper import DamperStep, DistanceDamper


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Where the servos are to go now. (J,) each, read-only."""

    position_rad: Array
    velocity_rad_s: Array
    torque_nm: Array | None = None
    """(2, J) least and greatest torque that the drives may give, N m at the joint; None: what they have."""
    ready: bool = True
    """False until the guard knows where every joint stands: write it to no servo."""


@dataclass(frozen=True, slots=True)
class LimiterStep:
    """A setpoint under way, and what it may do in the step at hand; (J,) each."""

    position_rad: Array
    velocity_rad_s: Array
    dt_s: float
    limits: MotionLimits
    max_velocity_rad_s: Array
    max_acceleration_rad_s2: Array


Envelope = Callable[[LimiterStep], tuple[Array, Array]]
"""The lowest and the highest velocity (J,) that keep a rule in this step."""


Slowed = Callable[[Array, Array, float], Array]
"""Slows wished velocities (J,), given where the setpoint is (J,) and how long the step is."""


def safe_speed(distance_rad: Array, acceleration_rad_s2: Array, dt_s: float) -> Array:
    """The fastest speed (J,) for one step after which braking at the given rate still fits.

    With p' = p + v dt, the largest v with v dt + v² / 2a ≤ d is  v = a dt (√(1 + 2 d / a dt²) - 1).
    Braking in steps takes less way than v² / 2a, whatever their length: so once kept, always kept.
    """
    step = acceleration_rad_s2 * dt_s
    out: Array = step * (np.sqrt(1.0 + 2.0 * distance_rad / (step * dt_s)) - 1.0)
    return out


def approach(error_rad: Array, goal_rad_s: Array, acceleration_rad_s2: Array, dt_s: float) -> Array:
    """Speed (J,), relative to a moving target, that closes an error and brakes in time.

    In units of a dt² the error is d; in units of a dt the target moves away at g ≥ 0, and the speed is
    min(d, max(½, √((1 + g)² + 2d) - 1 - g)).
    d closes the error in this very step: a target that keeps the limits is followed without lag, since
    half a step's acceleration is how far its mean velocity over a step differs from that at its end.
    The root is `safe_speed` for a target of speed v that may begin to brake now, with the joint's own a. It
    stops after v² / 2a; the joint, w faster and e behind, must stop there too: (v + w)² = v² + 2 a e. So a
    joint that its limits left behind does not pass where the target turns, also where steps are late.
    """
    step = acceleration_rad_s2 * dt_s
    distance = np.abs(error_rad) / (step * dt_s)
    # a target that comes towards the joint needs no room
    away = 1.0 + np.maximum(np.where(error_rad < 0.0, -goal_rad_s, goal_rad_s), 0.0) / step
    speed = np.minimum(distance, np.maximum(0.5, np.sqrt(away * away + 2.0 * distance) - away))
    out: Array = np.copysign(speed * step, error_rad)
    return out


def _position(motion: LimiterStep) -> tuple[Array, Array]:
    limits = motion.limits
    room = np.empty((2, len(limits.lower_rad)))
    np.subtract(motion.position_rad, limits.lower_rad, out=room[0])
    np.subtract(limits.upper_rad, motion.position_rad, out=room[1])
    # a joint that stands beyond its limit has no room on that side: it may only move back
    np.maximum(room, 0.0, out=room)
    speed = safe_speed(room, limits.max_acceleration_rad_s2, motion.dt_s)
    return -speed[0], speed[1]


def _velocity(motion: LimiterStep) -> tuple[Array, Array]:
    return -motion.max_velocity_rad_s, motion.max_velocity_rad_s


def _acceleration(motion: LimiterStep) -> tuple[Array, Array]:
    # gently up to speed where the caller wants it so; but braking may use all the joint has,
    # or a gentle limit that comes while the joint is fast would carry it beyond its position limit
    v = motion.velocity_rad_s
    gain = motion.max_acceleration_rad_s2 * motion.dt_s
    if motion.max_acceleration_rad_s2 is motion.limits.max_acceleration_rad_s2:
        return v - gain, v + gain
    brake = motion.limits.max_acceleration_rad_s2 * motion.dt_s
    low = np.where(v > 0.0, np.maximum(v - brake, -gain), v - gain)
    high = np.where(v < 0.0, np.minimum(v + brake, gain), v + gain)
    return low, high


RULES: tuple[tuple[Rule, Envelope], ...] = (
    (Rule.POSITION, _position),
    (Rule.VELOCITY, _velocity),
    (Rule.ACCELERATION, _acceleration),
)
"""In this order. The later wins: where a limit shrinks under a moving joint it brakes, and does not jump."""


class SetpointLimiter:
    """The setpoint of all J joints.

    Whatever is asked, for every joint and step: |v| ≤ its velocity limit, |Δv| ≤ its acceleration limit
    times dt, and the position stays within its limits, the way to brake included. A joint that stood beyond a
    limit when it was seated only ever moves back.
    """

    def __init__(
        self, joint_names: Sequence[str], limits: MotionLimits, damper: DistanceDamper | None = None
    ) -> None:
        """`damper`: keeps parts of the robot apart; None: nothing does."""
        self.damper = damper
        self._names = tuple(joint_names)
        self.slowed: Slowed = lambda position_rad, wish_rad_s, step_s: wish_rad_s
        self._none: Mask = np.zeros(len(self._names), np.bool_)
        self.limits = limits
        self.seat(limits.reachable(np.zeros(len(self._names))))

    def seat(self, position_rad: Array) -> None:
        """Put the setpoint where the joints stand (J,), at rest.

        A joint at its limit may read up to an encoder count beyond it: its setpoint is the limit. A joint
        that stands further beyond is held there, since a setpoint at the limit would make it jump.
        """
        within = self.limits.reachable(position_rad)
        by_reading = np.abs(position_rad - within) <= RAD_PER_COUNT
        self.position_rad: Array = np.where(by_reading, within, position_rad)
        """(J,) read-only."""
        self.velocity_rad_s: Array = np.zeros_like(position_rad)
        """(J,) read-only."""
        self.position_rad.flags.writeable = self.velocity_rad_s.flags.writeable = False
        self._clamped = dict.fromkeys(Rule, self._none)
        self._clamping = False

    def yield_to(self, position_rad: Array) -> None:
        """Put the setpoint where somebody has pushed the joints (J,), at rest, but not beyond their limits.

        A setpoint that is beyond a limit already goes no further beyond.
        """
        here, limits = self.position_rad, self.limits
        lowest, highest = np.minimum(here, limits.lower_rad), np.maximum(here, limits.upper_rad)
        self.seat(np.clip(position_rad, lowest, highest))

    @property
    def setpoint(self) -> Setpoint:
        """The setpoint now."""
        return Setpoint(self.position_rad, self.velocity_rad_s)

    @property
    def clamped(self) -> Mask:
        """(J,) joints that some rule held back in the newest step."""
        return np.logical_or.reduce(tuple(self._clamped.values())) if self._clamping else self._none

    @property
    def at_rest(self) -> bool:
        """Whether no joint's setpoint moves."""
        return not self.velocity_rad_s.any()

    def stop(self, dt_s: float) -> None:
        """Brake every joint as hard as it may; at standstill the setpoint stays.

        The damper has left room for that: nothing has to be looked at on the way.
        """
        if self.damper is not None:
            self.damper.idle()
        if dt_s <= 0.0 or self.at_rest:
            return
        brake = self.limits.max_acceleration_rad_s2 * dt_s
        self._clamped, self._clamping = dict.fromkeys(Rule, self._none), False
        self._move(self.velocity_rad_s - np.clip(self.velocity_rad_s, -brake, brake), dt_s)

    def step(
        self,
        now_ns: int,
        dt_s: float,
        target_rad: Array,
        target_rad_s: Array,
        held: Mask,
        max_velocity_rad_s: Array,
        max_acceleration_rad_s2: Array,
    ) -> list[Clamp]:
        """Move towards a moving target (J,); joints that are `held` brake and stay where they are.

        The maxima (J,) are those of this step, at most the joint's own. Returns the clamps that began.
        """
        if dt_s <= 0.0:
            return []
        goal = self.limits.reachable(target_rad)
        beyond = goal != target_rad
        # a target beyond the limit is one that stands at the limit
        goal_rad_s = np.where(beyond, 0.0, target_rad_s)
        error = goal - self.position_rad - goal_rad_s * dt_s
        wish = np.where(held, 0.0, goal_rad_s + approach(error, goal_rad_s, max_acceleration_rad_s2, dt_s))
        wish = self.slowed(self.position_rad, wish, dt_s)
        motion = LimiterStep(
            self.position_rad, self.velocity_rad_s, dt_s, self.limits,
            max_velocity_rad_s, max_acceleration_rad_s2,
        )  # fmt: skip
        given, lowest, highest = [wish], np.full_like(wish, -np.inf), np.full_like(wish, np.inf)
        for _, envelope in RULES:
            low, high = envelope(motion)
            given.append(np.minimum(np.maximum(given[-1], low), high))
            lowest = np.minimum(np.maximum(lowest, low), high)
            highest = np.minimum(np.maximum(highest, low), high)
        given.append(self._kept_apart(wish, given[-1], lowest, highest, held, motion))
        self._move(given[-1], dt_s)
        if not (self._clamping or beyond.any() or (given[-1] != wish).any()):
            return []
        return self._clamps(now_ns, target_rad, beyond, ~held, given, motion)

    def _kept_apart(
        self, aim: Array, wish: Array, lowest: Array, highest: Array, held: Mask, motion: LimiterStep
    ) -> Array:
        """The velocity (J,) at which no two parts come too near, within what the rules let."""
        if self.damper is None:
            return wish
        if not (wish.any() or motion.velocity_rad_s.any()):
            self.damper.idle()
            return wish
        brake = self.limits.max_acceleration_rad_s2
        slower = np.clip(motion.velocity_rad_s, -brake * motion.dt_s, brake * motion.dt_s)
        most = motion.max_velocity_rad_s
        step = DamperStep(
            position_rad=motion.position_rad,
            aim_rad_s=np.clip(aim, -most, most),
            wish_rad_s=wish,
            lowest_rad_s=np.where(held, wish, lowest),
            highest_rad_s=np.where(held, wish, highest),
            braking_rad_s=motion.velocity_rad_s - slower,
            max_velocity_rad_s=self.limits.max_velocity_rad_s,
            brake_rad_s2=brake,
            dt_s=motion.dt_s,
        )
        return self.damper.limit(step)

    def _move(self, velocity_rad_s: Array, dt_s: float) -> None:
        before, limits = self.position_rad, self.limits
        after = before + velocity_rad_s * dt_s
        # takes off what rounding may have added; never pulls in a joint that stands beyond its limit
        np.maximum(after, np.minimum(before, limits.lower_rad), out=after)
        np.minimum(after, np.maximum(before, limits.upper_rad), out=after)
        after.flags.writeable = velocity_rad_s.flags.writeable = False
        self.position_rad, self.velocity_rad_s = after, velocity_rad_s

    def _clamps(
        self,
        now_ns: int,
        target_rad: Array,
        beyond: Mask,
        free: Mask,
        given: list[Array],
        motion: LimiterStep,
    ) -> list[Clamp]:
        """The clamps that began in this step. A held joint brakes by order, and is not clamped by a rule."""
        clamps: list[Clamp] = []
        self._clamping = False
        rules = (*(rule for rule, _ in RULES), Rule.DISTANCE)
        for rule, before, after in zip(rules, given, given[1:], strict=False):
            clamped = (before != after) & free
            if rule is Rule.DISTANCE and self.damper is not None:
                clamped &= self.damper.held_back
            if rule is Rule.POSITION:
                clamped |= beyond & free
            for j in np.flatnonzero(clamped & ~self._clamped[rule]).tolist():
                asked, got = self._describe(rule, j, float(before[j]), float(after[j]), target_rad, motion)
                clamps.append(Clamp(now_ns, self._names[j], rule, asked, got))
            self._clamped[rule] = clamped
            self._clamping = self._clamping or bool(clamped.any())
        return clamps

    def _describe(
        self,
        rule: Rule,
        joint: int,
        asked_rad_s: float,
        given_rad_s: float,
        target_rad: Array,
        motion: LimiterStep,
    ) -> tuple[float, float]:
        """What was asked and what was given, in the rule's unit."""
        if rule in (Rule.VELOCITY, Rule.DISTANCE):
            return asked_rad_s, given_rad_s
        if rule is Rule.ACCELERATION:
            speed = float(motion.velocity_rad_s[joint])
            return (asked_rad_s - speed) / motion.dt_s, (given_rad_s - speed) / motion.dt_s
        lower, upper = float(self.limits.lower_rad[joint]), float(self.limits.upper_rad[joint])
        asked = float(target_rad[joint])
        if lower <= asked <= upper:
            # the target itself is allowed, but the joint would have come to rest beyond the limit
            braking = asked_rad_s**2 / (2.0 * float(self.limits.max_acceleration_rad_s2[joint]))
            asked = float(motion.position_rad[joint]) + asked_rad_s * motion.dt_s
            asked += braking if asked_rad_s > 0.0 else -braking
        return asked, min(max(asked, lower), upper)
