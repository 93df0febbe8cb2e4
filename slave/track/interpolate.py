"""Strategy `interpolate`: run smoothly from sample to sample, and so at least one period late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array
from slave.track.blend import Blend, Course, coast
from slave.track.lateness import Lateness
from slave.track.tracker import TrackTarget

_KEPT = 4
"""Segments remembered. The newest is played, or an older one where a slow link has suddenly become fast."""
_GAIN = 0.03
"""Share of a new measurement of the delay that is believed. Slow: a delay that changes is itself a motion."""
_RUN_OUT_S = 0.08
"""With no sample ahead the motion slows to rest within this time."""


@dataclass(frozen=True, slots=True)
class _Segment:
    """From one sample to the next."""

    start_ns: int
    end_ns: int
    ends: Array
    """(4, J): position and velocity at the start, then at the end."""


class Interpolate:
    """A `Tracker` that plays the samples back a little later than they need to arrive.

    Between two samples runs the cubic with their positions and velocities (Hermite), at the time
    `now - delay`. A segment may be played once its end has arrived: one period and one transit after
    its start. That is measured as arrival minus the capture of the sample before; the delay is its mean and
    its mean deviation, as for voice (Ramjee, Kurose, Towsley and Schulzrinne, INFOCOM 1994, with 1 deviation
    in place of 4: what comes later is bridged by coasting, not lost), and at least the margin.
    """

    def __init__(self, blend_s: float, jitter_margin_s: float) -> None:
        self._blend = Blend(blend_s)
        self._margin_s = jitter_margin_s
        self._newest_ns = 0
        self._newest: Course | None = None
        self._segments: list[_Segment] = []
        self._lateness = Lateness(_GAIN, _GAIN)

    @property
    def delay_s(self) -> float:
        """How late the samples are played, from their capture on."""
        return (self._lateness.mean_s or 0.0) + max(self._margin_s, self._lateness.spread_s)

    def reset(self) -> None:
        """Forget every sample, and how long they took."""
        self._newest = None
        self._segments = []
        self._lateness.reset()
        self._blend.reset()

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Append a sample (J,) if it is newer than the last."""
        before, before_ns = self._newest, self._newest_ns
        if before is not None and sampled_ns <= before_ns:
            return
        sample = np.stack([position_rad, velocity_rad_s])
        if before is not None:
            old = self._blend.applied(now_ns, self._course(before, now_ns))
            self._lateness.note(to_s(now_ns - before_ns))
            segment = _Segment(before_ns, sampled_ns, np.concatenate([before, sample]))
            self._segments = [*self._segments, segment][-_KEPT:]
        self._newest, self._newest_ns = sample, sampled_ns
        if before is not None:
            self._blend.begin(now_ns, old, self._course(sample, now_ns))

    def target(self, now_ns: int) -> TrackTarget | None:
        """The course as it was `delay_s` ago."""
        if self._newest is None:
            return None
        course = self._blend.applied(now_ns, self._course(self._newest, now_ns))
        return TrackTarget(course[0], course[1])

    def _course(self, newest: Course, now_ns: int) -> Course:
        play_ns = now_ns - to_ns(self.delay_s)
        if not self._segments:
            return _standing(newest[0])
        for segment in reversed(self._segments):
            if play_ns >= segment.end_ns:
                # only in the newest segment: no sample ahead
                ahead_s, rate = coast(to_s(play_ns - segment.end_ns), 0.0, _RUN_OUT_S)
                course: Course = np.array([[1.0, ahead_s], [0.0, rate]]) @ newest
                return course
            if play_ns >= segment.start_ns:
                return _between(segment, play_ns)
        return _standing(self._segments[0].ends[0])


def _standing(position_rad: Array) -> Course:
    return np.stack([position_rad, np.zeros_like(position_rad)])


def _between(segment: _Segment, at_ns: int) -> Course:
    """Hermite's cubic through two samples' positions and velocities, at a time between them."""
    span_s = to_s(segment.end_ns - segment.start_ns)
    x = to_s(at_ns - segment.start_ns) / span_s
    rise, slope = x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / span_s
    weights = np.array(
        [
            [1.0 - rise, span_s * x * (1.0 - x) ** 2, rise, span_s * x * x * (x - 1.0)],
            [-slope, 1.0 + x * (3.0 * x - 4.0), slope, x * (3.0 * x - 2.0)],
        ]
    )
    course: Course = weights @ segment.ends
    return course
