"""Strategy `predict`: extrapolate the operator to now, and ahead by the servos' own lag."""

from __future__ import annotations

import math

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from slave.track.blend import Course, coast
from slave.track.confidence import Confidence
from slave.track.continuation import Continuation
from slave.track.correction import Correction
from slave.track.estimate import Estimate, corrected, first
from slave.track.lateness import Lateness
from slave.track.persistence import Persistence, steadiness
from slave.track.spacing import Spacing
from slave.track.tracker import TrackTarget

_LEAST_FULL_S = 0.15
"""Followed at full rate up to this age at least, servo lag included; while nothing is measured up to this."""
_BRAKE_S = 0.15
"""Beyond the horizon it slows to rest within this time."""
_FARTHEST_RAD = 0.68
"""No joint is foretold to go farther than this, coasting included, whatever its velocity: within the guard's
`jump_window_rad`, beyond which all joints come back slowly."""
_PERIOD_S = 0.08
_DECAY, _EVEN_DECAY = 1.8, 6.0
"""A correction decays at 1.8 / blend_s at 12.5 Hz, on an even movement at 6 / blend_s: there it is small."""
_RATE_POWER = 0.415
"""At 25 Hz corrections are smaller: a third faster. At 50 Hz again a third."""


class Predict:
    """A `Tracker` that is where the operator is by now.

    The newest estimate (`estimate.py`) is carried on over s = age of the sample + servo lag for as long as
    the joint's own movement has lately kept its direction (`persistence.py`, `continuation.py`), and as far
    as that has come true (`confidence.py`). The horizon, up to which that is done at full rate, follows the
    ages that samples usually reach on this link (`lateness.py`): older ones mean a loss, and slow the
    robot to rest, `max_horizon_s` after the sample at the latest.
    """

    def __init__(self, blend_s: float, servo_lag_s: float, max_horizon_s: float) -> None:
        self._blend_s = blend_s
        self._servo_lag_s = servo_lag_s
        self._max_horizon_s = max_horizon_s
        self._correction = Correction()
        self._lateness = Lateness()
        self._spacing = Spacing()
        self._persistence = Persistence()
        self._confidence = Confidence()
        self._estimate: Estimate | None = None
        self._believed = Continuation(np.zeros((3, 0)), np.zeros(0))

    @property
    def horizon_s(self) -> float:
        """Age, servo lag included, up to which a sample is followed at full rate."""
        usual_s = max(self._lateness.late_s + self._servo_lag_s, _LEAST_FULL_S)
        return min(usual_s, max(self._max_horizon_s - _BRAKE_S, 0.5 * self._max_horizon_s))

    def reset(self) -> None:
        """Forget every sample, and what was learnt of the link."""
        self._estimate = None
        self._lateness.reset()
        self._spacing.reset()
        self._persistence.reset()
        self._confidence.reset()
        self._correction.reset()

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Change to the course that this sample (J,) makes likely, if it is newer than the last."""
        before = self._estimate
        if before is None:
            self._believe(first(sampled_ns, position_rad, velocity_rad_s), velocity_rad_s)
            return
        if sampled_ns <= before.sampled_ns:
            return
        old = self._correction.applied(now_ns, self._course(before, now_ns))
        self._lateness.note(to_s(now_ns - before.sampled_ns))
        elapsed_s = to_s(sampled_ns - before.sampled_ns)
        if elapsed_s > self._max_horizon_s:
            self._confidence.reset()
            self._persistence.reset()
            after = first(sampled_ns, position_rad, velocity_rad_s)
        else:
            mean_age_s = to_s(now_ns - sampled_ns) + 0.5 * elapsed_s + self._servo_lag_s
            self._spacing.note(elapsed_s)
            self._confidence.prove(sampled_ns, position_rad, mean_age_s)
            after = corrected(before, sampled_ns, position_rad, velocity_rad_s)
        self._believe(after, velocity_rad_s)
        self._correct(now_ns, old, self._course(after, now_ns))

    def target(self, now_ns: int) -> TrackTarget | None:
        """The course at `now_ns`."""
        if self._estimate is None:
            return None
        course = self._correction.applied(now_ns, self._course(self._estimate, now_ns))
        return TrackTarget(course[0], course[1])

    def _believe(self, estimate: Estimate, velocity_rad_s: Array) -> None:
        self._estimate = estimate
        # without velocities by those of the estimate
        seen_rad_s = velocity_rad_s if velocity_rad_s.any() else estimate.motion[1]
        self._persistence.note(estimate.sampled_ns, seen_rad_s)
        foretold = Continuation.of(estimate, self._persistence.lasts_s)
        self._confidence.note(estimate.sampled_ns, foretold)
        foretold = foretold.scaled(self._confidence.share)
        span_s, _ = self._coasted(math.inf)
        self._believed = foretold.scaled(_FARTHEST_RAD / np.maximum(foretold.farthest(span_s), _FARTHEST_RAD))

    def _correct(self, now_ns: int, old: Course, new: Course) -> None:
        # by the usual time between commands: one out of turn does not make this correction a small one
        rate = min(max(_PERIOD_S / (self._spacing.usual_s or _PERIOD_S), 1.0), 4.0)
        decay = _DECAY / self._blend_s * rate**_RATE_POWER
        faster = max(_EVEN_DECAY / self._blend_s - decay, 0.0)
        # a joint at rest seems steady; to follow its noise fast would shake the robot
        even = decay + faster * steadiness(self._believed.lasts_s) * self._persistence.moving
        self._correction.begin(now_ns, old, new, decay, even)

    def _course(self, estimate: Estimate, now_ns: int) -> Course:
        age_s = to_s(now_ns - estimate.sampled_ns) + self._servo_lag_s
        span_s, rate = self._coasted(age_s)
        course = self._believed.course(max(span_s, 0.0))
        course[1] *= rate
        return course

    def _coasted(self, age_s: float) -> tuple[float, float]:
        """How far an estimate of that age is carried on, s, and at which share of its rate."""
        full_s = self.horizon_s
        return coast(age_s, full_s, min(full_s + _BRAKE_S, self._max_horizon_s))
