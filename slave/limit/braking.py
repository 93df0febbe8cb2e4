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


class Looks:
    """Which moments of a way to look at, until nothing can come too near between any two of them.

    Of a kind of pairs that comes s towards each other from one look to the next, and has spares a and b in
    them, the first a and the last b are free. On what is left, s - a - b, two round parts come nearer by no
    more than they may if it is no longer than their stride. From the last look on, spares must be enough.
    """

    def __init__(self, apart_m: Array, spare_m: Array, stride_m: Array, parts: int, hope_m: float) -> None:
        """`apart_m` (K, R): how far each kind of pair may have come towards each other by each moment.

        `spare_m` (R,): what they have before the way begins; `stride_m` (R,). The first `parts` moments are
        of the step at hand, whose end is looked at unless nothing can be too near there: it is the next
        setpoint. A look tells spares up to `hope_m`.
        """
        self._apart_m, self._stride_m, self._hope_m = apart_m, stride_m, hope_m
        self._setpoint = parts - 1
        self._sure = -1
        """Up to this moment the way is free."""
        self._gone_m, self._spare_m = np.zeros_like(spare_m), spare_m
        """(R,) how far each kind has come by then, and its spare there."""
        self._ahead: list[tuple[int, Array]] = []
        """Moments that were looked at and their spares (R,); the nearest last."""

    def next(self, suspect: int | None = None) -> int | None:
        """The next moment to look at; None: the way is free. First of all `suspect`, if it is of use."""
        apart_m = self._apart_m
        last = len(apart_m) - 1
        while True:
            left_m = self._gone_m + self._spare_m
            if (apart_m[last] <= left_m).all():
                return None
            if suspect is not None:
                return min(max(suspect, self._setpoint), last)
            ahead = self._ahead[-1][0] if self._ahead else last + 1
            if self._sure < self._setpoint < ahead and (apart_m[self._setpoint] > left_m).any():
                return self._setpoint
            strides_m = left_m + self._stride_m
            if self._ahead:
                spare_m = self._ahead[-1][1]
                if ahead == self._sure + 1 or (apart_m[ahead] <= strides_m + spare_m).all():
                    self._ahead.pop()
                    self._sure, self._gone_m, self._spare_m = ahead, apart_m[ahead], spare_m
                    continue
                self._hope_m = 0.0  # what was hoped for did not come true: no more of that
            # mostly there will be as much to spare as here
            hoped_m = strides_m + np.minimum(self._spare_m, self._hope_m)
            return self._furthest(apart_m[self._sure + 1 : ahead], hoped_m)

    def _furthest(self, apart_m: Array, most_m: Array) -> int:
        """The last moment by which no kind has come further than `most_m` (R,), but one on at least."""
        within: Mask = np.all(apart_m <= most_m, axis=1)
        count = len(within) if within[-1] else int(np.argmin(within))
        return self._sure + max(count, 1)

    def saw(self, moment: int, spare_m: Array) -> None:
        """What a look at the moment that was asked for last found: spares (R,), none below 0."""
        self._ahead.append((moment, spare_m))
