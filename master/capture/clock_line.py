"""When free-running nodes sampled, on the master's clock, from arrivals and their own times or counts. Pure.

A frame arrives some time after its sample, and that time varies; it is never less than a least. So the least
delayed arrivals show the node's clock, as in the clock filter of NTP (Mills 2010): the sample time goes on by
the node's own step, comes down to an arrival that is earlier at once, and follows later ones slowly:

    t ← t + b Δ;    t ← a where a < t;    else t ← t + (1 − e^(−bΔ/τ)) (a − t)

Δ is the step of the node's own time or count, or, without either, the number of periods since the last
arrival; b is the length of a step, learnt over some seconds: 100 ppm of drift are then 0.2 ms of error.
"""

from __future__ import annotations

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
_SMOOTH = 0.05


class ClockLines:
    """State of N nodes. Times in seconds from a start that the caller chooses."""

    def __init__(self, stamp_wrap_s: Array, counter_wrap: Array, period_s: Array) -> None:
        """(N,) each: wraps of own time and count, 0 where there is none; the period, NaN if not known."""
        count = len(period_s)
        self._stamp_wrap_s, self._counter_wrap = stamp_wrap_s, counter_wrap.astype(np.float64)
        self._stamped: Mask = stamp_wrap_s > 0.0
        self._counted: Mask = ~self._stamped & (counter_wrap > 0)
        self._step_s = np.where(self._stamped, 1.0, period_s)
        self.period_s = period_s.copy()
        """(N,) from sample to sample; NaN until it is known."""
        self._learning: list[list[tuple[float, float]]] = [[] for _ in range(count)]
        self._own = np.full(count, np.nan)
        self._last_s = np.full(count, np.nan)
        self._steps = np.zeros(count)
        self._anchor = np.full((2, count), np.nan)
        self.jitter_s = np.zeros(count)
        """(N,) by how much arrivals are late, on average."""
        self.missing = np.zeros(count, np.int64)
        """(N,) samples that never came."""
        self.duplicates = np.zeros(count, np.int64)
        self.resets = np.zeros(count, np.int64)

    def take(self, rows: NDArray[np.intp], arrival_s: Array, stamp_s: Array, counts: Array) -> Array:
        """Sample times (F,) of F samples in the order of arrival; NaN for one that was seen before."""
        out = np.full(len(rows), np.nan)
        repeats = np.bincount(rows, minlength=len(self.period_s))
        newest = np.zeros(len(self.period_s))
        newest[rows] = arrival_s
        seen: dict[int, int] = {}
        rounds: list[list[int]] = []
        for place, row in enumerate(rows.tolist()):
            turn = seen[row] = seen.get(row, -1) + 1
            if turn == len(rounds):
                rounds.append([])
            rounds[turn].append(place)
        for turn, chosen in enumerate(rounds):
            here = np.array(chosen, np.intp)
            of = rows[here]
            own = np.where(self._stamped[of], stamp_s[here], counts[here])
            left = repeats[of] - 1 if turn == 0 else np.full(len(of), -1)
            out[here] = self._round(of, arrival_s[here], own, newest[of], left)
        return out

    def _round(
        self, of: NDArray[np.intp], arrival_s: Array, own: Array, newest_s: Array, left: NDArray[np.int64]
    ) -> Array:
        """One sample of each of some nodes; `left` more come with it, -1: it is one of these."""
        begins = np.isnan(self._last_s[of])
        delta = self._delta(of, own, newest_s, left)
        repeated = ~begins & (delta == 0.0)
        self.duplicates[of] += repeated
        before = self._last_s[of]
        step_s = self._step_s[of]
        with np.errstate(invalid="ignore"):
            expected = before + step_s * delta
            late = arrival_s - expected
            share = 1.0 - np.exp(-np.maximum(step_s * delta, 0.0) / _FOLLOW_S)
            time_s = np.where(late < 0.0, arrival_s, expected + share * late)
            # two samples are never one instant, however a burst of arrivals looks
            time_s = np.maximum(time_s, before + 0.1 * step_s * delta)
            lost = ~begins & (np.abs(late) > _RESET_S)
        self.resets[of] += lost & ~repeated
        unknown = begins | lost | np.isnan(step_s)
        time_s = np.where(unknown, arrival_s, time_s)
        self._own[of] = own
        good = ~repeated
        self._count(of[good & ~unknown], (time_s - before)[good & ~unknown], delta[good & ~unknown])
        late = np.where(unknown, 0.0, np.maximum(late, 0.0))
        self.jitter_s[of] += _SMOOTH * (late - self.jitter_s[of])
        self._last_s[of[good]] = time_s[good]
        self._steps[of[good]] += np.where(begins | lost, 0.0, delta)[good]
        again = of[lost & good]
        self._anchor[:, again] = np.nan
        unlearnt = np.isnan(self.period_s[of])
        if unlearnt.any():
            self._learn(of[unlearnt & good])
        self._tune(of[good & ~unknown])
        return np.where(repeated, np.nan, time_s)

    def _delta(self, of: NDArray[np.intp], own: Array, newest_s: Array, left: NDArray[np.int64]) -> Array:
        """Steps since each node's last sample."""
        wrap = np.where(self._stamped[of], self._stamp_wrap_s[of], self._counter_wrap[of])
        with np.errstate(invalid="ignore", divide="ignore"):
            by_own = np.mod(own - self._own[of], np.where(wrap > 0.0, wrap, np.inf))
            by_own = np.where(self._stamped[of], by_own, np.rint(by_own))
            # what a stall held back comes at once: the steps are those up to the newest
            periods = np.rint((newest_s - self._last_s[of]) / self.period_s[of])
        by_arrival = np.where(left < 0, 1.0, np.maximum(np.nan_to_num(periods, nan=1.0) - left, 1.0))
        return np.where(np.isnan(self._own[of]) | ~(wrap > 0.0), by_arrival, by_own)

    def _count(self, of: NDArray[np.intp], took_s: Array, delta: Array) -> None:
        """Lost samples, and the period of nodes that lost none."""
        period_s = self.period_s[of]
        with np.errstate(invalid="ignore"):
            gone = np.where(self._stamped[of], np.rint(took_s / period_s), delta) - 1.0
        gone = np.maximum(np.nan_to_num(gone), 0.0)
        self.missing[of] += gone.astype(np.int64)
        whole = (gone == 0.0) & ~np.isnan(period_s)
        self.period_s[of[whole]] += _SMOOTH * (took_s - period_s)[whole]

    def _learn(self, of: NDArray[np.intp]) -> None:
        """The first period of nodes whose step is not known."""
        for row in of.tolist():
            seen = self._learning[row]
            seen.append((float(self._last_s[row]), float(self._steps[row])))
            if len(seen) < _LEARN:
                continue
            times = np.array([time_s for time_s, _ in seen])
            if self._counted[row]:
                period_s = (times[-1] - times[0]) / max(seen[-1][1] - seen[0][1], 1.0)
            else:
                gaps = np.diff(times)
                usual = float(np.median(gaps))
                period_s = gaps.sum() / max(np.rint(gaps / usual).sum(), 1.0) if usual > 0.0 else gaps.mean()
            self.period_s[row] = period_s
            if not self._stamped[row]:
                self._step_s[row] = period_s
            self._learning[row] = []

    def _tune(self, of: NDArray[np.intp]) -> None:
        """The length of a step, over `_BASE_S`."""
        anchor_s, anchor_steps = self._anchor[0, of], self._anchor[1, of]
        ran_s = self._last_s[of] - anchor_s
        new = of[np.isnan(anchor_s) | (ran_s > _BASE_S)]
        if len(new) == 0:
            return
        due = ran_s > _BASE_S
        rows = of[due]
        step_s = ran_s[due] / np.maximum(self._steps[rows] - anchor_steps[due], 1e-9)
        near = np.abs(step_s / self._step_s[rows] - 1.0) < _LARGEST_DRIFT
        self._step_s[rows[near]] += 0.5 * (step_s - self._step_s[rows])[near]
        self._anchor[:, new] = self._last_s[new], self._steps[new]

    def lose(self, nodes: Mask) -> None:
        """Forget when nodes (N,) sampled last, as their bus has failed; their steps' length stays."""
        self._last_s[nodes] = np.nan
        self._own[nodes] = np.nan
        self._anchor[:, nodes] = np.nan
