"""The last samples of N nodes, and what they read at an instant between two of them. Pure."""

from __future__ import annotations

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
    age_s: Array
    """(N,) from the newest sample to now; inf before the first."""


class SampleHistory:
    """State of N nodes. Times in seconds, on the clock of `ClockLines`."""

    def __init__(self, count: int, measured: Mask, turning: Mask) -> None:
        """(N,) `measured`: nodes with an accelerometer; `turning`: with a gyro. Others give orientations."""
        self._derived_acc: NDArray[np.intp] = np.flatnonzero(~measured)
        self._derived_gyr: NDArray[np.intp] = np.flatnonzero(~turning)
        self._times = np.full((KEPT, count), -np.inf)
        self._values = np.full((KEPT, count, WIDTH), np.nan)
        self._next = [0] * count
        self._newest = [-np.inf] * count
        self._all = np.arange(count)
        self._derived_rate = np.zeros((len(self._derived_gyr), 3))

    def put(self, rows: NDArray[np.intp], times_s: Array, values: Array) -> None:
        """Samples (F,) and (F, 13), of each node in order. Those without a time are left out."""
        newest, following, slots, kept = self._newest, self._next, [], []
        for place, (row, time_s) in enumerate(zip(rows.tolist(), times_s.tolist(), strict=True)):
            if time_s > newest[row]:
                newest[row] = time_s
                slot = following[row]
                slots.append(slot)
                kept.append(place)
                following[row] = (slot + 1) % KEPT
        of = rows[kept]
        self._times[slots, of] = times_s[kept]
        self._values[slots, of] = values[kept]

    def at(self, instant_s: float, now_s: float, period_s: Array) -> Instant:
        """What the nodes read at an instant; `period_s` (N,), NaN where it is not known."""
        times, everyone = self._times, self._all
        before = times <= instant_s
        slot_0 = np.where(before, times, -np.inf).argmax(axis=0)
        slot_1 = np.where(before, np.inf, times).argmin(axis=0)
        t_0, t_1 = times[slot_0, everyone], times[slot_1, everyone]
        follows = t_1 > instant_s
        with np.errstate(invalid="ignore", divide="ignore"):
            gap = np.where(follows, t_1 - t_0, np.inf)
            share = np.where(follows, (instant_s - t_0) / gap, 0.0)
        share[~np.isfinite(share)] = 0.0
        v_0 = self._values[slot_0, everyone]
        v_1 = np.where(follows[:, None], self._values[slot_1, everyone], v_0)
        values = v_0 + share[:, None] * (v_1 - v_0)
        mag, other = values[:, MAG], v_0[:, MAG]
        values[:, MAG] = np.where(np.isnan(mag), other, mag)
        since = np.where(np.isfinite(t_0), instant_s - t_0, np.inf)
        usual_s = np.where(np.isnan(period_s), 0.01, period_s)
        held = ~follows & (since <= _HELD_PERIODS * usual_s)
        self._orient(values, v_0, v_1, gap, np.where(follows, 0.0, np.minimum(since, 0.05)), share)
        known = (follows & (gap <= LONGEST_GAP_S)) | held
        return Instant(values, known, held, now_s - np.array(self._newest))

    def _orient(
        self, values: Array, v_0: Array, v_1: Array, gap: Array, ahead_s: Array, share: Array
    ) -> None:
        """Orientations between two, or brought forward from the last one; and what follows from them."""
        fused = ~np.isnan(v_0[:, TURN.start])
        if not fused.any():
            return
        q_0 = np.where(fused[:, None], v_0[:, TURN], IDENTITY)
        q_1 = np.where(np.isnan(v_1[:, TURN]), q_0, v_1[:, TURN])
        q_1 = np.where((q_0 * q_1).sum(axis=1, keepdims=True) < 0.0, -q_1, q_1)
        derived = self._derived_gyr
        if len(derived):
            turn = to_rotation_vector(multiply(conjugate(q_0[derived]), q_1[derived]))
            with np.errstate(invalid="ignore"):
                rate = turn / gap[derived, None]
            apart = np.isfinite(gap[derived])[:, None]
            # while a sample is held over the last rate goes on
            self._derived_rate = np.where(apart, rate, self._derived_rate)
            values[derived, GYR] = self._derived_rate
        rate = np.nan_to_num(values[:, GYR])
        q = normalise(q_0 + share[:, None] * (q_1 - q_0))
        q = multiply(q, from_rotation_vector(ahead_s[:, None] * rate))
        values[:, TURN] = np.where(fused[:, None], q, np.nan)
        weightless = self._derived_acc
        if len(weightless):
            values[weightless, ACC] = rotate(conjugate(q[weightless]), np.array([0.0, 0.0, G_M_S2]))
