"""Strategy `predict`: extrapolate the operator to now, and ahead by the servos' own lag."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from slave.track.blend import Blend, Course, coast
from slave.track.tracker import Target

# The three constants are the knee of a grid over simulated reaches; README.md has the figures.
_FORGET_S = 0.15
"""A reach's acceleration does not last: extrapolated, it decays with this time constant."""
_POSITION_GAIN = 0.6
"""Share of a position sample that differs from the prediction which is believed."""
_ACCELERATION_GAIN = 1.2
"""Share of the surprise in velocity, over the time since the last sample, taken as acceleration.

Above 1, since the mean over the past period says what the acceleration was half a period ago."""
_LEAST_SPAN_S = 0.03
"""A surprise counts as spread over at least this time. Over the few ms between a sample made up for and the
next, or after a step of the measured clock offset, mere noise would be an enormous acceleration."""


@dataclass(frozen=True, slots=True)
class _Estimate:
    """What is known of the operator's motion since the newest sample."""

    sampled_ns: int
    sample_rad: Array
    motion: Array
    """(3, J): position, velocity and acceleration at `sampled_ns`."""


class Predict:
    """A `Tracker` that is where the operator is by now.

    Position p, velocity v and acceleration a at the newest sample are carried on as
    p + v s + a τ (s - τ (1 - exp(-s/τ))), the mean course of a manoeuvring target after Singer (IEEE
    Trans. AES-6, 1970), over s = age of the sample + servo lag. Old age slows it to rest.
    """

    def __init__(self, blend_s: float, servo_lag_s: float, max_horizon_s: float) -> None:
        self._blend = Blend(blend_s)
        self._servo_lag_s = servo_lag_s
        self._max_horizon_s = max_horizon_s
        self._estimate: _Estimate | None = None

    def reset(self) -> None:
        """Forget every sample."""
        self._estimate = None
        self._blend.reset()

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Change to the course that this sample (J,) makes likely, if it is newer than the last."""
        before = self._estimate
        if before is None:
            self._estimate = _first(sampled_ns, position_rad, velocity_rad_s)
            return
        if sampled_ns <= before.sampled_ns:
            return
        old = self._blend.applied(now_ns, self._course(before, now_ns))
        if to_s(sampled_ns - before.sampled_ns) > self._max_horizon_s:
            after = _first(sampled_ns, position_rad, velocity_rad_s)
        else:
            after = _next(before, sampled_ns, position_rad, velocity_rad_s)
        self._estimate = after
        self._blend.begin(now_ns, old, self._course(after, now_ns))

    def target(self, now_ns: int) -> Target | None:
        """The course at `now_ns`."""
        if self._estimate is None:
            return None
        course = self._blend.applied(now_ns, self._course(self._estimate, now_ns))
        return Target(course[0], course[1])

    def _course(self, estimate: _Estimate, now_ns: int) -> Course:
        age_s = to_s(now_ns - estimate.sampled_ns) + self._servo_lag_s
        span_s, rate = coast(age_s, 0.5 * self._max_horizon_s, self._max_horizon_s)
        course: Course = _carried(span_s, rate) @ estimate.motion
        return course


def _first(sampled_ns: int, position_rad: Array, velocity_rad_s: Array) -> _Estimate:
    """All that one sample tells; its acceleration is taken as zero."""
    motion = np.stack([position_rad, velocity_rad_s, np.zeros_like(position_rad)])
    return _Estimate(sampled_ns, motion[0], motion)


def _next(before: _Estimate, sampled_ns: int, position_rad: Array, velocity_rad_s: Array) -> _Estimate:
    """The estimate so far, corrected by a new sample with fixed gains."""
    elapsed_s = to_s(sampled_ns - before.sampled_ns)
    if not velocity_rad_s.any():
        # unknown, or at rest: either way the positions tell
        velocity_rad_s = (position_rad - before.sample_rad) / elapsed_s
    expected = _carried(elapsed_s, 1.0) @ before.motion
    surprise = (velocity_rad_s - expected[1]) / max(elapsed_s, _LEAST_SPAN_S)
    motion = np.stack(
        [
            expected[0] + _POSITION_GAIN * (position_rad - expected[0]),
            velocity_rad_s,
            before.motion[2] * math.exp(-elapsed_s / _FORGET_S) + _ACCELERATION_GAIN * surprise,
        ]
    )
    return _Estimate(sampled_ns, position_rad.copy(), motion)


def _carried(span_s: float, rate: float) -> Array:
    """(2, 3): takes p, v, a to position and velocity `span_s` later, passed through at `rate`."""
    gained = _FORGET_S * (1.0 - math.exp(-span_s / _FORGET_S))
    return np.array([[1.0, span_s, _FORGET_S * (span_s - gained)], [0.0, rate, rate * gained]])
