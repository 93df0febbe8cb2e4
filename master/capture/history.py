"""The last samples of N nodes, and what they read at an instant between two of them. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import (
    IDENTITY,
    Array,
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_rotation_vector,
)
from common.wire.messages import Mask
from master.capture.parts import ACC, GYR, MAG, TURN
from master.capture.units import G_M_S2

KEPT = 32
"""Samples of each node: 80 ms of one at 400 Hz."""
LONGEST_GAP_S = 0.1
"""Two samples farther apart say nothing of what was between them."""
_HELD_PERIODS = 2.0
"""For so long after its last sample a node's rate is taken to go on."""
_USUAL_S = 0.01
"""The period of a node whose own is not known yet."""
_LONGEST_AHEAD_S = 0.05
WIDTH = 13


@dataclass(frozen=True, slots=True)
class Instant:
    """All nodes at one instant."""

    values: Array
    """(N, 13): accelerometer, gyro, magnetometer, q_world_from_sensor; NaN where there is none."""
    known: Mask
    """(N,) sampled on both sides of the instant, or shortly before it."""
    held: Mask
    """(N,) known, but no sample has come after the instant: the last one is held over."""


@dataclass(frozen=True, slots=True)
class _Between:
    """Where an instant lies between two samples of each of N nodes."""

    slots: list[int]
    """Of the last sample that is not after it, among all nodes' samples."""
    following: list[int]
    """Of the first one after it; the same where the two do not tell what was between them."""
    share: Array
    """(N, 1) of the way from one to the other."""
    gap_s: Array
    """(N,) between the two; inf where they are the same."""
    ahead_s: Array
    """(N, 1) since the last sample, where none follows."""
    known: Mask
    held: Mask
    """(N,) each, as in `Instant`."""


class SampleHistory:
    """State of N nodes. Times in seconds, on the clock of `ClockLines`.

    Times are plain numbers: the sample before the instant is looked for from where the last one was found,
    which takes a step or two a node.
    """

    def __init__(self, count: int, measured: Mask, turning: Mask) -> None:
        """(N,) `measured`: nodes with an accelerometer; `turning`: with a gyro. Others give orientations."""
        self._derived_acc: NDArray[np.intp] = np.flatnonzero(~measured)
        self._derived_gyr: NDArray[np.intp] = np.flatnonzero(~turning)
        self._count = count
        self._times = [[-math.inf] * KEPT for _ in range(count)]
        """Of each node, round and round."""
        self._values = np.full((count * KEPT, WIDTH), np.nan)
        """Of all nodes, one after the other."""
        self._newest = [0] * count
        """The place of each node's newest sample in its times."""
        self._before = [0] * count
        """The place of the last one that is not after the last instant."""
        self._derived_rate = np.zeros((len(self._derived_gyr), 3))

    def put(self, rows: Sequence[int], times_s: Sequence[float], values: Array) -> None:
        """F samples, values (F, 13), of each node in order. Those without a time, NaN, are left out."""
        slots, kept = [], []
        for place, (row, time_s) in enumerate(zip(rows, times_s, strict=True)):
            times, slot = self._times[row], self._newest[row]
            if time_s > times[slot]:
                self._newest[row] = slot = (slot + 1) % KEPT
                if slot == self._before[row]:
                    self._before[row] = (slot + 1) % KEPT
                times[slot] = time_s
                slots.append(row * KEPT + slot)
                kept.append(place)
        self._values[slots] = values if len(kept) == len(values) else values[kept]

    def newest_s(self) -> list[float]:
        """When each node's newest sample was taken; -inf before the first."""
        return [times[newest] for times, newest in zip(self._times, self._newest, strict=True)]

    def at(self, instant_s: float, period_s: Sequence[float]) -> Instant:
        """What the nodes read at an instant; `period_s` of each of the N, NaN where it is not known.

        No instant may be earlier than the one before.
        """
        between = self._find(instant_s, period_s)
        v_0, v_1 = self._values[between.slots], self._values[between.following]
        values = v_0 + between.share * (v_1 - v_0)
        mag = values[:, MAG]
        missing = np.isnan(mag)
        if missing.any():
            values[:, MAG] = np.where(missing, v_0[:, MAG], mag)
        fused = ~np.isnan(v_0[:, TURN.start])
        if fused.any():
            self._orient(values, fused, between, v_0[:, TURN], v_1[:, TURN])
        return Instant(values, between.known, between.held)

    def _find(self, instant_s: float, period_s: Sequence[float]) -> _Between:
        count = self._count
        slots, following, shares, gaps = [], [], [], []
        known, held = np.ones(count, np.bool_), np.zeros(count, np.bool_)
        ahead_s = np.zeros((count, 1))
        for row, times in enumerate(self._times):
            newest, slot = self._newest[row], self._before[row]
            after = slot
            while slot != newest:
                after = (slot + 1) % KEPT
                if times[after] > instant_s:
                    break
                slot = after
            self._before[row] = slot
            since, gap = instant_s - times[slot], times[after] - times[slot]
            share = 0.0
            # all samples of a node may be after the instant: the first ones, or after a burst of them
            if 0.0 <= since < gap <= LONGEST_GAP_S:
                share = since / gap
            else:
                usual_s = _USUAL_S if math.isnan(period_s[row]) else period_s[row]
                stands = slot == newest and since <= _HELD_PERIODS * usual_s
                known[row] = held[row] = stands
                ahead_s[row] = min(since, _LONGEST_AHEAD_S) if stands else 0.0
                after, gap = slot, math.inf
            slots.append(row * KEPT + slot)
            following.append(row * KEPT + after)
            shares.append(share)
            gaps.append(gap)
        return _Between(slots, following, np.array(shares)[:, None], np.array(gaps), ahead_s, known, held)

    def _orient(self, values: Array, fused: Mask, between: _Between, q_0: Array, q_1: Array) -> None:
        """Orientations between two, or brought forward from the last one; and what follows from them."""
        q_0 = np.where(fused[:, None], q_0, IDENTITY)
        q_1 = np.where(np.isnan(q_1), q_0, q_1)
        q_1 = np.where((q_0 * q_1).sum(axis=1, keepdims=True) < 0.0, -q_1, q_1)
        derived = self._derived_gyr
        if len(derived):
            turn = to_rotation_vector(multiply(conjugate(q_0[derived]), q_1[derived]))
            gap_s = between.gap_s[derived, None]
            # while a sample is held over the last rate goes on
            self._derived_rate = np.where(np.isfinite(gap_s), turn / gap_s, self._derived_rate)
            values[derived, GYR] = self._derived_rate
        rate = np.nan_to_num(values[:, GYR])
        q = normalise(q_0 + between.share * (q_1 - q_0))
        q = multiply(q, from_rotation_vector(between.ahead_s * rate))
        values[:, TURN] = np.where(fused[:, None], q, np.nan)
        weightless = self._derived_acc
        if len(weightless):
            values[weightless, ACC] = rotate(conjugate(q[weightless]), np.array([0.0, 0.0, G_M_S2]))
