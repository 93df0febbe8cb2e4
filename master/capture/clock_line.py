"""When free-running nodes sampled, on the master's clock, from arrivals and their own times or counts. Pure.

A frame arrives some time after its sample, and that time varies; it is never less than a least. So the least
delayed arrivals show the node's clock, as in the clock filter of NTP (Mills 2010): the sample time goes on by
the node's own step, comes down to an arrival that is earlier at once, and follows later ones slowly:

    t ← t + b Δ;    t ← a where a < t;    else t ← t + (1 − e^(−bΔ/τ)) (a − t)

Δ is the step of the node's own time or count, or, without either, the number of periods since the last
arrival; b is the length of a step, learnt over some seconds: 100 ppm of drift are then 0.2 ms of error.

A node without a time of its own that from some time on samples slower or faster (it is throttled, or was
set anew) is learnt again once two windows of arrivals agree on that: by its old step its samples would seem
ever older. Where it counts, a window's arrivals are divided by its counts. Where it does not, only arrivals
can tell lost samples: the step is the mean of the gaps that are about as long as most. A node of which every
second sample is lost cannot be told from one that samples half as often.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

_FOLLOW_S = 2.0
_LEARN = 24
"""Samples from which the first period is taken."""
_BASE_S = 5.0
"""The step's length is taken over so long."""
_RESET_S = 0.25
"""Own time and arrivals that differ by more: the node has begun anew, or its clock was set."""
_LARGEST_DRIFT = 0.01
_COUNTED_DRIFT = 0.06
"""Of a counting node's step: beyond the least change of its rate that two windows tell. What a stall held
back is no other number of counts, as it may be of arrivals."""
_SLIPS = 0.003
"""A usual gap over `_BASE_S` that differs so much from the step of a node that neither counts nor tells time:
samples are then taken for lost that were never sent. Jitter of 1 ms makes 0.05 %."""
_SMOOTH = 0.05
_WINDOW, _CHANGED = 24.0, 0.05
"""Counts, of which two windows in a row must tell another rate by this share, and agree within half of it."""
_ALIKE = 0.6
"""Gaps between arrivals that differ from most by less, as a share, are those of a step."""
_TOLD = 0.01
"""A step that is longer or shorter by less is no other rate."""
_BACK = 8.0
"""A sample that is older than the last one by at most so many steps was overtaken by it."""


class NodeLine:
    """What is known of one node's clock. Plain numbers: some 40 samples come in a tick, in turn."""

    def __init__(self, stamp_wrap_s: float, counter_wrap: float, period_s: float) -> None:
        self._stamped = stamp_wrap_s > 0.0
        self._counted = not self._stamped and counter_wrap > 0.0
        self._wrap = stamp_wrap_s if self._stamped else counter_wrap
        self._far = _RESET_S if self._stamped else _BACK
        self._step_s = 1.0 if self._stamped else period_s
        self._most_drift = _COUNTED_DRIFT if self._counted else _LARGEST_DRIFT
        self.period_s = period_s
        self._learning: list[tuple[float, float]] = []
        self._own = self._last_s = self._anchor_s = self._anchor_steps = math.nan
        self._steps = 0.0
        self.jitter_s = 0.0
        self.missing = self.duplicates = self.resets = self.overtaken = self.rate_changes = 0
        self._strayed = self._mark_s = self._window_step_s = math.nan
        self._marked = 0.0
        self._early_s, self._early, self._refine_at = math.nan, 0.0, 2.0 * _LEARN
        """The arrival from which a counting node's step is refined, counts since, and at how many next."""
        self._arrived_s: list[float] = []
        self._usual_s, self._usual = 0.0, 0
        """Sum and number of the usual gaps since the step was compared with them."""

    def take(self, arrival_s: float, own: float, newest_s: float, left: int) -> float:
        """When a sample was taken; NaN if it was seen before.

        `own`: its own time or count. `left` more come with it until `newest_s`; -1: it is one of those.
        """
        before, step_s = self._last_s, self._step_s
        delta = self._delta(own, newest_s, left)
        if delta > self._far and self._overtook(own):
            self.overtaken += 1
            return math.nan
        self._own = own
        if math.isnan(before):
            return self._at(arrival_s)
        if delta == 0.0:
            self.duplicates += 1
            return math.nan
        if math.isnan(step_s):
            self._steps += delta
            return self._at(arrival_s)
        expected = before + step_s * delta
        late = arrival_s - expected
        if not self._stamped and self._changed_rate(arrival_s, delta):
            self.rate_changes += 1
            self._anchor_s = math.nan
            return self._at(arrival_s)
        if abs(late) > _RESET_S:
            self.resets += 1
            self._anchor_s = math.nan
            return self._at(arrival_s)
        time_s = arrival_s
        if late >= 0.0:
            time_s = expected + (1.0 - math.exp(-step_s * delta / _FOLLOW_S)) * late
            self.jitter_s += _SMOOTH * late
        self.jitter_s -= _SMOOTH * self.jitter_s
        # two samples are never one instant, however a burst of arrivals looks
        time_s = max(time_s, before + 0.1 * step_s * delta)
        self._count(time_s - before, delta)
        self._steps += delta
        self._last_s = time_s
        if math.isnan(self.period_s):
            self._learn()
        if self._counted:
            self._refine(arrival_s, delta)
        if not time_s - self._anchor_s <= _BASE_S:  # or nothing is anchored yet
            self._tune()
        return time_s

    def _overtook(self, own: float) -> bool:
        """Whether the last sample overtook this one. Where another follows this one, the node began anew."""
        unit = 1.0 if self._counted else self.period_s
        if not self._wrap > 0.0 or not (self._own - own) % self._wrap <= _BACK * unit:
            return False
        follows = (own - self._strayed) % self._wrap <= 1.5 * unit
        self._strayed = math.nan if follows else own
        return not follows

    def _changed_rate(self, arrival_s: float, delta: float) -> bool:
        """Whether arrivals tell another rate than the node's step; then it is taken over."""
        step_s = self._counted_step(arrival_s, delta) if self._counted else self._usual_step(arrival_s)
        if math.isnan(step_s):
            return False
        before_s, self._window_step_s = self._window_step_s, step_s
        slower, alike = step_s / self._step_s - 1.0, step_s / before_s - 1.0
        if abs(slower) > _CHANGED and abs(alike) < 0.5 * _CHANGED:
            return self._goes_on_with(0.5 * (step_s + before_s))
        if self._usual_s < _BASE_S:
            return False
        usual_s = self._usual_s / self._usual
        self._usual_s, self._usual = 0.0, 0
        slips = abs(usual_s / self._step_s - 1.0)
        if slips > _SLIPS:
            self._goes_on_with(usual_s)
        return slips > _TOLD

    def _goes_on_with(self, step_s: float) -> bool:
        self._step_s = self.period_s = step_s
        self._usual_s, self._usual = 0.0, 0
        return True

    def _counted_step(self, arrival_s: float, delta: float) -> float:
        """The step of a window of counts; NaN until it is full."""
        self._marked += delta
        if math.isnan(self._mark_s) or delta > _WINDOW:
            self._mark_s, self._marked = arrival_s, 0.0
        if self._marked < _WINDOW:
            return math.nan
        step_s = (arrival_s - self._mark_s) / self._marked
        self._mark_s, self._marked = arrival_s, 0.0
        return step_s

    def _usual_step(self, arrival_s: float) -> float:
        """The step of a window of arrivals, without gaps of lost samples and of stalls; NaN until full."""
        arrived = self._arrived_s
        arrived.append(arrival_s)
        if len(arrived) <= _WINDOW:
            return math.nan
        self._arrived_s = [arrival_s]
        gaps = [after - before for before, after in pairwise(arrived)]
        usual_s = median(gaps)
        near = [gap for gap in gaps if abs(gap - usual_s) < _ALIKE * usual_s]
        if len(near) <= _WINDOW / 2.0:
            return math.nan  # a window of bursts tells nothing
        self._usual_s += sum(near)
        self._usual += len(near)
        return sum(near) / len(near)

    def _at(self, arrival_s: float) -> float:
        """A sample of which only its arrival tells the time."""
        self._last_s = arrival_s
        self.jitter_s -= _SMOOTH * self.jitter_s
        if math.isnan(self.period_s):
            self._learn()
        return arrival_s

    def _delta(self, own: float, newest_s: float, left: int) -> float:
        """Steps since the last sample."""
        if self._wrap > 0.0 and math.isfinite(own - self._own):
            delta = (own - self._own) % self._wrap
            return delta if self._stamped else float(round(delta))
        # what a stall held back comes at once: the steps are those up to the newest
        periods = (newest_s - self._last_s) / self.period_s
        if left < 0 or math.isnan(periods):
            return 1.0
        return float(max(round(periods) - left, 1))

    def _count(self, took_s: float, delta: float) -> None:
        """Lost samples, and the period of a node that lost none."""
        period_s = self.period_s
        gone = (took_s / period_s if self._stamped else delta) - 1.0
        if gone <= 0.5:
            if not math.isnan(period_s):
                self.period_s = period_s + _SMOOTH * (took_s - period_s)
        elif not math.isnan(gone):
            self.missing += round(gone)

    def _learn(self) -> None:
        """The first period of a node whose period is not known."""
        seen = self._learning
        seen.append((self._last_s, self._steps))
        if len(seen) < _LEARN:
            return
        self._learning = []
        times = [time_s for time_s, _ in seen]
        spent_s = times[-1] - times[0]
        if spent_s <= 0.0:
            return  # all of them were held back until one instant, which tells nothing of a period
        if self._counted:
            period_s = spent_s / max(seen[-1][1] - seen[0][1], 1.0)
        else:
            gaps = [after - before for before, after in pairwise(times)]
            usual_s = median(gaps)
            many = sum(round(gap / usual_s) for gap in gaps) if usual_s > 0.0 else len(gaps)
            period_s = spent_s / max(many, 1)
        self.period_s = period_s
        if not self._stamped:
            self._step_s = period_s

    def _refine(self, arrival_s: float, delta: float) -> None:
        """Until `_BASE_S` have passed: the step by all arrivals, each time that they have doubled.

        The first period is taken of 24 samples. Those of a quick node take so short a time that the jitter of
        arrivals makes it wrong by a percent, and its samples 10 ms too old within a second.
        """
        if math.isnan(self._anchor_s):  # nothing before this sample belongs to it
            self._early_s, self._early = arrival_s, 0.0
            return
        self._early += delta
        if self._early < self._refine_at:
            return
        self._refine_at *= 2.0
        spent_s = arrival_s - self._early_s
        if spent_s > _BASE_S:
            self._refine_at = math.inf  # from now on `_tune` alone, by the line itself
        step_s = spent_s / self._early
        if abs(step_s / self._step_s - 1.0) < self._most_drift:
            self._step_s = step_s

    def _tune(self) -> None:
        """The length of a step, over `_BASE_S`."""
        ran_s = self._last_s - self._anchor_s
        if ran_s > _BASE_S:
            step_s = ran_s / max(self._steps - self._anchor_steps, 1e-9)
            if abs(step_s / self._step_s - 1.0) < self._most_drift:
                self._step_s += 0.5 * (step_s - self._step_s)
        self._anchor_s, self._anchor_steps = self._last_s, self._steps

    def lose(self) -> None:
        """Forget when it sampled last; its step's length stays."""
        self._last_s = self._own = self._anchor_s = self._mark_s = self._strayed = math.nan
        self._arrived_s = []


class ClockLines:
    """The lines of N nodes. Times in seconds from a start that the caller chooses."""

    def __init__(self, stamp_wrap_s: Array, counter_wrap: Array, period_s: Array) -> None:
        """(N,) each: wraps of own time and count, 0 where there is none; the period, NaN if not known."""
        of_each = zip(stamp_wrap_s.tolist(), counter_wrap.tolist(), period_s.tolist(), strict=True)
        self._nodes = [NodeLine(stamp_s, float(counter), period) for stamp_s, counter, period in of_each]
        self._own_is_stamp = (stamp_wrap_s > 0.0).tolist()

    def take(
        self,
        rows: Sequence[int],
        arrival_s: Sequence[float],
        stamp_s: Sequence[float],
        counts: Sequence[float],
    ) -> list[float]:
        """Sample times of F samples, each node's in the order of arrival; NaN if seen before."""
        nodes = self._nodes
        newest = dict(zip(rows, arrival_s, strict=True))
        left: dict[int, int] = {}
        for row in rows:
            left[row] = left.get(row, -1) + 1
        out = []
        for row, at_s, stamp, count in zip(rows, arrival_s, stamp_s, counts, strict=True):
            own = stamp if self._own_is_stamp[row] else count
            out.append(nodes[row].take(at_s, own, newest[row], left[row]))
            left[row] = -1
        return out

    @property
    def period_s(self) -> Array:
        """(N,) from sample to sample; NaN until it is known."""
        return np.array(self.periods_s)

    @property
    def periods_s(self) -> list[float]:
        """As plain numbers."""
        return [node.period_s for node in self._nodes]

    @property
    def jitter_s(self) -> Array:
        """(N,) by how much arrivals are late, on average."""
        return np.array([node.jitter_s for node in self._nodes])

    @property
    def missing(self) -> NDArray[np.int64]:
        """(N,) samples that never came."""
        return np.array([node.missing for node in self._nodes], np.int64)

    @property
    def duplicates(self) -> NDArray[np.int64]:
        """(N,) samples that came twice."""
        return np.array([node.duplicates for node in self._nodes], np.int64)

    @property
    def resets(self) -> NDArray[np.int64]:
        """(N,) times that a node began anew."""
        return np.array([node.resets for node in self._nodes], np.int64)

    @property
    def overtaken(self) -> NDArray[np.int64]:
        """(N,) samples that came after a newer one, and were left out."""
        return np.array([node.overtaken for node in self._nodes], np.int64)

    @property
    def rate_changes(self) -> NDArray[np.int64]:
        """(N,) times that a node went on at another rate."""
        return np.array([node.rate_changes for node in self._nodes], np.int64)

    def lose(self, nodes: Mask) -> None:
        """Forget when nodes (N,) sampled last, as their bus has failed; their steps' length stays."""
        for row in np.flatnonzero(nodes).tolist():
            self._nodes[row].lose()
