"""Strategy `interpolate`: run smoothly from sample to sample, and so at least one period late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array
from slave.track.blend import Blend, Course, coast
from slave.track.tracker import Target

_KEPT = 4
"""Samples remembered: the play time lies between the last two, or one earlier where several came at once."""
_DELAY_GAIN = 0.1
"""Share of a new measurement of the delay that is believed: ten periods or so to follow a change."""
_MOST_GROWTH = 1.5
"""A sample later than this many delays is one that followed a lost one: it counts as just so late."""
_RUN_OUT_S = 0.08
"""With no sample ahead the motion slows to rest within this time."""


@dataclass(frozen=True, slots=True)
class _Sample:
    sampled_ns: int
    course: Course


class Interpolate:
    """A `Tracker` that plays the samples back a little later than they need to arrive.

    Between two samples runs the cubic with their positions and velocities (Hermite), at the time
    `now - delay`. A segment may be played once its end has arrived: one period and one transit after
    its start. That is measured as arrival minus the capture of the sample before, smoothed.
    """

    def __init__(self, blend_s: float, jitter_margin_s: float) -> None:
        self._blend = Blend(blend_s)
        self._margin_s = jitter_margin_s
        self._samples: list[_Sample] = []
        self._wait_s: float | None = None

    @property
    def delay_s(self) -> float:
        """How late the samples are played, from their capture on."""
        return (self._wait_s or 0.0) + self._margin_s

    def reset(self) -> None:
        """Forget every sample, and how long they took."""
        self._samples = []
        self._wait_s = None
        self._blend.reset()

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Append a sample (J,) if it is newer than the last."""
        sample = _Sample(sampled_ns, np.stack([position_rad, velocity_rad_s]))
        if not self._samples:
            self._samples = [sample]
            return
        newest = self._samples[-1]
        if sampled_ns <= newest.sampled_ns:
            return
        old = self._blend.applied(now_ns, self._course(now_ns))
        self._measure(to_s(now_ns - newest.sampled_ns))
        self._samples = [*self._samples[1 - _KEPT :], sample]
        self._blend.begin(now_ns, old, self._course(now_ns))

    def target(self, now_ns: int) -> Target | None:
        """The course as it was `delay_s` ago."""
        if not self._samples:
            return None
        course = self._blend.applied(now_ns, self._course(now_ns))
        return Target(course[0], course[1])

    def _measure(self, wait_s: float) -> None:
        if self._wait_s is None:
            self._wait_s = wait_s
        else:
            self._wait_s += _DELAY_GAIN * (min(wait_s, _MOST_GROWTH * self._wait_s) - self._wait_s)

    def _course(self, now_ns: int) -> Course:
        play_ns = now_ns - to_ns(self.delay_s)
        newest, oldest = self._samples[-1], self._samples[0]
        if self._wait_s is None or play_ns <= oldest.sampled_ns:
            # the first sample, or one not yet due: stand there
            return np.stack([oldest.course[0], np.zeros_like(oldest.course[0])])
        if play_ns >= newest.sampled_ns:
            ahead_s, rate = coast(to_s(play_ns - newest.sampled_ns), 0.0, _RUN_OUT_S)
            course: Course = np.array([[1.0, ahead_s], [0.0, rate]]) @ newest.course
            return course
        end = next(i for i, s in enumerate(self._samples) if s.sampled_ns > play_ns)
        return _between(self._samples[end - 1], self._samples[end], play_ns)


def _between(start: _Sample, end: _Sample, at_ns: int) -> Course:
    """Hermite's cubic through two samples' positions and velocities, at a time between them."""
    span_s = to_s(end.sampled_ns - start.sampled_ns)
    x = to_s(at_ns - start.sampled_ns) / span_s
    rise = x * x * (3.0 - 2.0 * x)
    slope = 6.0 * x * (1.0 - x) / span_s
    from_start = np.array([[1.0 - rise, span_s * x * (1.0 - x) ** 2], [-slope, 1.0 + x * (3.0 * x - 4.0)]])
    from_end = np.array([[rise, span_s * x * x * (x - 1.0)], [slope, x * (3.0 * x - 2.0)]])
    course: Course = from_start @ start.course + from_end @ end.course
    return course
