"""The way of all joints from a velocity to standstill, and which moments of it to look at. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

_PERIOD_S = 0.006
"""A step longer than this is late."""
_SHORTEST_S = 0.001
"""The way to standstill is looked at in steps no shorter than this, however soon after the last one this
one comes: half of it, at 2 m/s, is as far as the damper's skin."""


@dataclass(frozen=True, slots=True)
class BrakingWay:
    """What the joints go until they stand, at K moments."""

    velocity_rad_s: Array
    """(J,) that it begins with."""
    brake_rad_s2: Array
    dt_s: float
    """The step at hand, in which the joints do not brake yet."""
    gone_rad: Array
    """(K, J)"""
    parts: int
    """How many of the moments are parts of the step at hand."""
    period_s: float
    """From one moment to the next."""

    def moving_s(self, k: int) -> Array:
        """(J,) for how long each joint has moved by moment k: the derivative of its way by its velocity."""
        if k < self.parts:
            return np.full_like(self.velocity_rad_s, min((k + 1) * self.period_s, self.dt_s))
        moves = np.floor(np.abs(self.velocity_rad_s) / (self.brake_rad_s2 * self.period_s))
        return np.asarray(self.dt_s + self.period_s * np.minimum(k + 1 - self.parts, moves))


def way_to_stop(velocity_rad_s: Array, brake_rad_s2: Array, dt_s: float) -> BrakingWay:
    """The step at hand first, a late one in parts; then each joint brakes, step by step, until it stands.

    After n steps of braking a joint of speed s, which sheds a in each, has gone (n s - a n (n + 1) / 2) of
    their time further, n at most s / a.
    """
    parts = math.ceil(dt_s / _PERIOD_S)
    period_s = max(dt_s / parts, _SHORTEST_S)
    shed = brake_rad_s2 * period_s
    speed = np.abs(velocity_rad_s)
    moves = np.floor(speed / shed)
    braked = np.minimum(np.arange(max(int(moves.max()), 0) + 1)[:, None], moves)
    way = dt_s * speed + period_s * braked * (speed - (0.5 * shed) * (braked + 1.0))
    if parts > 1:
        way = np.vstack([np.arange(1, parts)[:, None] * (period_s * speed), way])
    return BrakingWay(velocity_rad_s, brake_rad_s2, dt_s, np.copysign(way, velocity_rad_s), parts, period_s)


def next_look(apart_m: Array, spare_m: Array, stride_m: Array, parts: int = 0) -> int | None:
    """The next moment of a way to look at; None: none, as nothing can come too near on the rest of it.

    `apart_m` (K, R): how far each kind of pair may have come towards each other since the last look, in which
    it had `spare_m` (R,). As late as no kind has gone further than its spare and its `stride_m` (R,), but one
    moment on at least. The end of the step at hand, moment `parts` - 1, is the next setpoint: it is looked at
    unless nothing can be too near there.
    """
    last = len(apart_m) - 1
    free: Mask = np.all(apart_m <= spare_m, axis=1)
    if free[last]:
        return None
    if parts and not free[parts - 1]:
        return parts - 1
    allowed: Mask = np.all(apart_m <= np.maximum(spare_m, stride_m), axis=1)
    return last if allowed[last] else max(int(np.argmin(allowed)) - 1, 0)
