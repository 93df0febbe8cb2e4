"""Per-joint limits on the setpoint: it may ask for anything, and is given what the joint can safely do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.messages import Mask
from common.quaternion import Array
from slave.guard.events import Clamp, Rule


@dataclass(frozen=True, slots=True)
class Limits:
    """What each joint may do at most, (J,) each."""

    lower_rad: Array
    upper_rad: Array
    max_velocity_rad_s: Array
    max_acceleration_rad_s2: Array

    def reachable(self, position_rad: Array) -> Array:
        """Positions (J,) brought within the position limits."""
        out: Array = np.minimum(np.maximum(position_rad, self.lower_rad), self.upper_rad)
        return out


@dataclass(frozen=True, slots=True)
class Motion:
    """A setpoint under way, and what it may do in the step at hand; (J,) each."""

    position_rad: Array
    velocity_rad_s: Array
    dt_s: float
    limits: Limits
    max_velocity_rad_s: Array
    max_acceleration_rad_s2: Array


Envelope = Callable[[Motion], tuple[Array, Array]]
"""The lowest and the highest velocity (J,) that keep a rule in this step."""


def safe_speed(distance_rad: Array, acceleration_rad_s2: Array, dt_s: float) -> Array:
    """The fastest speed (J,) for one step after which braking at the given rate still fits.

    With p' = p + v dt, the largest v with v dt + v² / 2a ≤ d is  v = a dt (√(1 + 2 d / a dt²) - 1).
    Braking in steps takes less way than v² / 2a, whatever their length: so once kept, always kept.
    """
    step = acceleration_rad_s2 * dt_s
    out: Array = step * (np.sqrt(1.0 + 2.0 * distance_rad / (step * dt_s)) - 1.0)
    return out


def approach(error_rad: Array, acceleration_rad_s2: Array, dt_s: float) -> Array:
    """Speed (J,), relative to a moving target, that closes an error and brakes in time.

    In units of a dt² the error is d; the speed in units of a dt is  min(d, max(½, √(1 + 2d) - 1)).
    d closes the error in this very step: a target that keeps the limits is followed without lag, since
    half a step's acceleration is how far its mean velocity over a step differs from that at its end.
    The root is `safe_speed`: a far target is reached without overshoot, also where steps come late.
    """
    step = acceleration_rad_s2 * dt_s
    distance = np.abs(error_rad) / (step * dt_s)
    speed = np.minimum(distance, np.maximum(0.5, np.sqrt(1.0 + 2.0 * distance) - 1.0))
    out: Array = np.copysign(speed * step, error_rad)
    return out


def _position(motion: Motion) -> tuple[Array, Array]:
    limits = motion.limits
    # a joint that stands beyond its limit has no room on that side: it may only move back
    room = np.maximum(
        np.stack((motion.position_rad - limits.lower_rad, limits.upper_rad - motion.position_rad)), 0.0
    )
    speed = safe_speed(room, limits.max_acceleration_rad_s2, motion.dt_s)
    return -speed[0], speed[1]


def _velocity(motion: Motion) -> tuple[Array, Array]:
    return -motion.max_velocity_rad_s, motion.max_velocity_rad_s


def _acceleration(motion: Motion) -> tuple[Array, Array]:
    # gently up to speed where the caller wants it so; but braking may use all the joint has,
    # or a gentle limit that comes while the joint is fast would carry it beyond its position limit
    v = motion.velocity_rad_s
    gain = motion.max_acceleration_rad_s2 * motion.dt_s
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

    Whatever is asked, for every joint and step: |v| ≤ its velocity limit, |Δv| ≤ its acceleration limit · dt,
    and the position stays within its limits, the way to brake included. A joint seated beyond a limit moves back only.
    """

    def __init__(self, joint_names: Sequence[str], limits: Limits) -> None:
        self._names = tuple(joint_names)
        self.limits = limits
        self.position_rad: Array = np.zeros(len(self._names))
        """(J,) read-only."""
        self.velocity_rad_s: Array = np.zeros(len(self._names))
        """(J,) read-only."""
        self._clamped: dict[Rule, Mask] = {}
        self._release()

    def seat(self, position_rad: Array) -> None:
        """Put the setpoint where the joints stand (J,), at rest."""
        self.position_rad = position_rad.copy()
        self.velocity_rad_s = np.zeros_like(position_rad)
        self._release()

    @property
    def at_rest(self) -> bool:
        """Whether no joint's setpoint moves."""
        return not self.velocity_rad_s.any()

    def stop(self, dt_s: float) -> None:
        """Brake every joint as hard as it may; at standstill the setpoint stays."""
        if dt_s <= 0.0 or self.at_rest:
            return
        brake = self.limits.max_acceleration_rad_s2 * dt_s
        self._release()
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
        wish = np.where(held, 0.0, goal_rad_s + approach(error, max_acceleration_rad_s2, dt_s))
        motion = Motion(
            self.position_rad, self.velocity_rad_s, dt_s, self.limits,
            max_velocity_rad_s, max_acceleration_rad_s2,
        )  # fmt: skip
        free = ~held
        clamps: list[Clamp] = []
        for rule, envelope in RULES:
            low, high = envelope(motion)
            given = np.minimum(np.maximum(wish, low), high)
            clamped = given != wish
            if rule is Rule.POSITION:
                clamped |= beyond
            clamped &= free
            began = clamped & ~self._clamped[rule]
            if began.any():
                clamps += self._describe(now_ns, rule, began, wish, given, target_rad, motion)
            self._clamped[rule] = clamped
            wish = given
        self._move(wish, dt_s)
        return clamps

    def _move(self, velocity_rad_s: Array, dt_s: float) -> None:
        before = self.position_rad
        after = before + velocity_rad_s * dt_s
        # takes off what rounding may have added; never pulls in a joint that stands beyond its limit
        after = np.maximum(after, np.minimum(before, self.limits.lower_rad))
        after = np.minimum(after, np.maximum(before, self.limits.upper_rad))
        after.flags.writeable = velocity_rad_s.flags.writeable = False
        self.position_rad, self.velocity_rad_s = after, velocity_rad_s

    def _release(self) -> None:
        self.position_rad.flags.writeable = self.velocity_rad_s.flags.writeable = False
        none = np.zeros(len(self._names), np.bool_)
        self._clamped = dict.fromkeys(Rule, none)

    def _describe(
        self,
        now_ns: int,
        rule: Rule,
        began: Mask,
        asked_rad_s: Array,
        given_rad_s: Array,
        target_rad: Array,
        motion: Motion,
    ) -> list[Clamp]:
        clamps = []
        for j in np.flatnonzero(began).tolist():
            asked, given = float(asked_rad_s[j]), float(given_rad_s[j])
            if rule is Rule.POSITION:
                asked = self._aim(j, asked, float(target_rad[j]), motion)
                given = min(max(asked, float(self.limits.lower_rad[j])), float(self.limits.upper_rad[j]))
            elif rule is Rule.ACCELERATION:
                speed = float(motion.velocity_rad_s[j])
                asked, given = (asked - speed) / motion.dt_s, (given - speed) / motion.dt_s
            clamps.append(Clamp(now_ns, self._names[j], rule, asked, given))
        return clamps

    def _aim(self, joint: int, asked_rad_s: float, target_rad: float, motion: Motion) -> float:
        """Where a joint was asked to be, or else would have come to rest."""
        if not self.limits.lower_rad[joint] <= target_rad <= self.limits.upper_rad[joint]:
            return target_rad
        braking = asked_rad_s * abs(asked_rad_s) / (2.0 * float(self.limits.max_acceleration_rad_s2[joint]))
        return float(motion.position_rad[joint]) + asked_rad_s * motion.dt_s + braking
