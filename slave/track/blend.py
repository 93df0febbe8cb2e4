"""Changes of course without a jump: the difference is carried on and worked off."""

from __future__ import annotations

import numpy as np

from common.clock import to_s
from common.quaternion import Array

Course = Array
"""(2, J): position, rad, and velocity, rad/s, of a motion at one instant."""

LARGE_RAD = 0.25
"""A joint's difference larger than this, as after a loss, takes longer in proportion: nothing rushes it."""
JUMP_RAD = 0.7
"""A difference larger than this is no correction. It is worked off as soon as a small one, so that the guard
behind sees it (its `jump_window_rad`) and leads the robot there slowly: spread out it would go unnoticed."""


class Blend:
    """The difference old minus new course at a change, led to zero by a cubic within `duration_s`.

    With x = t / T, error e and its rate r at the change, the cubic of Hermite's that ends at rest on
    zero is  e (1 - 3x² + 2x³) + r T (x - 2x² + x³). So position and velocity stay continuous. T is each
    joint's own: no joint waits for another's correction.
    """

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._began_ns = 0
        self._difference: Course | None = None
        self._total_s: Array = np.zeros(0)
        self._longest_s = 0.0

    def reset(self) -> None:
        """Nothing is left to work off."""
        self._difference = None

    def begin(self, now_ns: int, old: Course, new: Course) -> None:
        """The course changes from `old`, which holds what was left until now, to `new`."""
        self._began_ns = now_ns
        self._difference = old - new
        far = np.abs(self._difference[0])
        times = np.where(far > JUMP_RAD, 1.0, np.maximum(far / LARGE_RAD, 1.0))
        self._total_s = self._duration_s * times
        self._longest_s = float(self._total_s.max())

    def applied(self, now_ns: int, course: Course) -> Course:
        """The new course with what is left of the difference."""
        if self._difference is None:
            return course
        elapsed_s = to_s(now_ns - self._began_ns)
        if elapsed_s >= self._longest_s:
            return course
        total_s, (error, rate) = self._total_s, self._difference
        x = np.minimum(elapsed_s / total_s, 1.0)
        left = 1.0 - x
        out: Course = course.copy()
        out[0] += error * (1.0 + x * x * (2.0 * x - 3.0)) + rate * (total_s * x * left * left)
        out[1] += error * (6.0 * x * (x - 1.0) / total_s) + rate * (1.0 + x * (3.0 * x - 4.0))
        return out


def coast(age_s: float, full_s: float, rest_s: float) -> tuple[float, float]:
    """How far to follow an extrapolation of age `age_s`, s, and at which share of its rate.

    At full rate up to `full_s`, then slowing smoothly (rate 1 - 3x² + 2x³) to rest at `rest_s`.
    """
    if age_s <= full_s:
        return age_s, 1.0
    brake_s = rest_s - full_s
    x = min((age_s - full_s) / brake_s, 1.0)
    return full_s + brake_s * x * (1.0 + x * x * (0.5 * x - 1.0)), 1.0 + x * x * (2.0 * x - 3.0)
