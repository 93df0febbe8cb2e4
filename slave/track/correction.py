"""A new course without a jump: the difference from the old one decays, critically damped."""

from __future__ import annotations

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from slave.track.blend import JUMP_RAD, LARGE_RAD, Course

_SURPRISE_RAD = 0.1
"""What is above this is too large to be led away as fast as on an even movement."""


class Correction:
    """The difference e, old minus new course, and its rate r at the change, led to zero.

        e(t) = e^(-w t) (e + (r + w e) t)

    Position and velocity stay continuous, and nothing swings. w is each joint's own: `even_per_s` where the
    difference is small against `_SURPRISE_RAD`, else `decay_per_s`. A large difference, as after a loss,
    decays more slowly in proportion. One that is a jump does not: the guard sees it.
    """

    def __init__(self) -> None:
        self._began_ns = 0
        self._left: Course | None = None
        self._decay_per_s: Array = np.zeros(0)

    def reset(self) -> None:
        """Nothing is left to work off."""
        self._left = None

    def begin(self, now_ns: int, old: Course, new: Course, decay_per_s: float, even_per_s: Array) -> None:
        """The course changes from `old`, with what was left until now, to `new`; `even_per_s` is (J,)."""
        self._began_ns = now_ns
        left = old - new
        far = np.abs(left[0])
        surprise = (far + np.abs(left[1]) / decay_per_s) / _SURPRISE_RAD
        decay = decay_per_s + (even_per_s - decay_per_s) / (1.0 + surprise * surprise)
        self._decay_per_s = decay / np.where(far > JUMP_RAD, 1.0, np.maximum(far / LARGE_RAD, 1.0))
        left[1] += self._decay_per_s * left[0]
        self._left = left

    def applied(self, now_ns: int, course: Course) -> Course:
        """The new course with what is left of the difference; changes `course`."""
        if self._left is None:
            return course
        elapsed_s, w = to_s(now_ns - self._began_ns), self._decay_per_s
        error, rate = self._left
        fade = np.exp(-w * elapsed_s)
        left = fade * (error + elapsed_s * rate)
        course[0] += left
        course[1] += fade * rate - w * left
        return course
