"""What the calibration of the alignment asks of the operator: stand still, then move every joint at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from common.quaternion import Array
from common.skeleton import Skeleton

PUT_ON_S = 3.0
ZERO_POSE_S = 6.0
MOVING_S = 30.0
_RAMP_S = 1.0
_MARGIN_RAD = math.radians(2.0)
_LARGEST_RAD = math.radians(45.0)
"""Either way from the middle of a joint's range."""
_SHARE = 0.5
"""Of each joint's velocity limit at most."""
_SLOWEST_HZ, _FASTEST_HZ = 0.35, 0.85
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class JointMoves:
    """Some movement as the suit is put on, the zero pose, then all joints swing, each at a rhythm of its own.

    Position = rest + e(t) (middle − rest + A sin(ω t + φ)) with an envelope e that rises and falls smoothly
    (quintic), so that position, velocity and acceleration are continuous, the seam of the loop included.
    """

    def __init__(self, skeleton: Skeleton, moving_s: float = MOVING_S) -> None:
        lower, upper = skeleton.lower_rad + _MARGIN_RAD, skeleton.upper_rad - _MARGIN_RAD
        self.zero_pose_from_s = PUT_ON_S
        self.zero_pose_until_s = PUT_ON_S + ZERO_POSE_S
        self.period_s = self.zero_pose_until_s + moving_s
        self._rest = np.clip(skeleton.zero_rad, skeleton.lower_rad, skeleton.upper_rad)
        self._bursts = ((0.0, PUT_ON_S), (self.zero_pose_until_s, self.period_s))
        # rhythms that are no simple multiples of each other, so that no two joints keep in step
        place = np.mod(_GOLDEN * np.arange(1, len(lower) + 1), 1.0)
        omega = 2.0 * math.pi * (_SLOWEST_HZ + (_FASTEST_HZ - _SLOWEST_HZ) * place)
        reach = np.minimum(0.5 * (upper - lower), _LARGEST_RAD)
        self._swing = np.minimum(reach, _SHARE * skeleton.max_velocity_rad_s / omega)
        self._middle = np.clip(skeleton.zero_rad, lower + self._swing, upper - self._swing) - self._rest
        self._omega = omega
        self._phase = 2.0 * math.pi * np.mod(_GOLDEN * place * 97.0, 1.0)

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""
        t = np.mod(np.asarray(t_s, dtype=np.float64), self.period_s)[..., None]
        e, e1, e2 = (sum(parts) for parts in zip(*(_envelope(t, *b) for b in self._bursts), strict=True))
        angle = self._omega * t + self._phase
        x = self._middle + self._swing * np.sin(angle)
        x1 = self._swing * self._omega * np.cos(angle)
        x2 = -self._swing * self._omega**2 * np.sin(angle)
        return self._rest + e * x, e1 * x + e * x1, e2 * x + 2.0 * e1 * x1 + e * x2


def _envelope(t: Array, begin_s: float, end_s: float) -> tuple[Array, Array, Array]:
    """0 → 1 → 0 over an interval, with its two derivatives."""
    up = _ramp((t - begin_s) / _RAMP_S)
    down = _ramp((end_s - t) / _RAMP_S)
    # one of the two is constant wherever the other moves
    return (
        up[0] * down[0],
        (up[1] - down[1]) / _RAMP_S,
        (up[2] + down[2]) / _RAMP_S**2,
    )


def _ramp(u: Array) -> tuple[Array, Array, Array]:
    u = np.clip(u, 0.0, 1.0)
    rest = 1.0 - u
    return (
        u**3 * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * (u * rest) ** 2,
        60.0 * u * rest * (rest - u),
    )
