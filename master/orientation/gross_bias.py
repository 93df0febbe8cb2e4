"""A gyro's bias that is too large for a filter to learn: found at rest, and taken off before the filter.

A filter takes a reading beyond some degrees a second for a turn: VQF's rest ends at 2 °/s, and its bias is
clipped there. What tells a bias from a turn is that nothing else turns: gravity stays where it is in the
sensor, and so does the field. A turn about the vertical that no magnetometer sees is told apart by its
steadiness alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

PERIOD_S = 0.2
"""From one look to the next: single readings, as a mean over the time between would hide motion."""
_LOOKS = 10
"""In the window, 2 s."""
_HALF_S = 0.5 * _LOOKS * PERIOD_S
_LONGEST_GAP_S = 0.5
_NEAR_RAD_S, _NEAR_M_S2 = math.radians(2.0), 0.5
"""How far the readings at rest may lie from their mean, as in `rest.py`."""
_STEADY_RAD_S = math.radians(1.0)
_STEADY_LOOKS = 12
"""Further looks for which a turn about the vertical must stay as steady as no person turns, 2.4 s."""
_TURNS_RAD_S = math.radians(1.5)
"""Gravity or field turning faster than this: no rest."""
_FEWEST_LOOKS = 3
"""With a rate so steady over so many looks a node may have a bias that is yet to be told from a turn."""
_GYR, _ACC, _MAG = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(slots=True)
class _BiasState:
    """n nodes."""

    offset: Array
    """rad/s (n, 3), taken off each reading."""
    beyond_rad_s: Array
    """(n,) what was found at rest beyond the limit; 0 where nothing was."""
    ring: Array
    """The last looks (_LOOKS, n, 9), the newest at `newest`; NaN where there was none."""
    steady: NDArray[np.int64]
    """Looks in a row that were steady (n,)."""
    newest: int = 0
    elapsed_s: float = 0.0


class GrossBias:
    """Offsets of n gyros. Nothing is changed before one was found."""

    def __init__(self, limit_rad_s: float, reach_rad_s: float, count: int) -> None:
        """`limit_rad_s`: of what is learnt, 0 for nothing; `reach_rad_s`: what the filter itself learns."""
        self._limit, self._reach = limit_rad_s, reach_rad_s
        self._state = _BiasState(
            offset=np.zeros((count, 3)),
            beyond_rad_s=np.zeros(count),
            ring=np.full((_LOOKS, count, 9), np.nan),
            steady=np.zeros(count, dtype=np.int64),
        )
        self.some = False
        """Whether any node has an offset."""

    @property
    def offset_rad_s(self) -> Array:
        """(n, 3)."""
        return self._state.offset

    @property
    def beyond_rad_s(self) -> Array:
        """(n,) rate at rest that is too large to be learnt; 0 where there is none."""
        return self._state.beyond_rad_s

    def undecided(self) -> Mask:
        """(n,) nodes that read a large and steady rate: a bias yet to be learnt, or too large to be.

        Such a node may also turn as steadily as a machine. It says nothing of how its wearer moves.
        """
        ring = self._state.ring
        looks: Mask = np.logical_and.reduce(np.isfinite(ring[:, :, :6]), axis=2)
        count = looks.sum(axis=0)
        seen = np.where(looks[..., None], ring[:, :, :6], 0.0)
        mean = seen.sum(axis=0) / np.maximum(count, 1)[:, None]
        off = np.abs(np.where(looks[..., None], seen - mean, 0.0)).max(axis=0)
        still = (off[:, _GYR].max(axis=1) < _NEAR_RAD_S) & (off[:, _ACC].max(axis=1) < _NEAR_M_S2)
        large = np.abs(mean[:, _GYR] - self._state.offset).max(axis=1) > self._reach
        return np.asarray((count >= _FEWEST_LOOKS) & still & large)

    def due(self, dt_s: float) -> bool:
        """One tick passes; True where it is time to `look`."""
        state = self._state
        if dt_s > _LONGEST_GAP_S:
            state.ring[:] = np.nan
        state.elapsed_s += dt_s
        if state.elapsed_s < PERIOD_S:
            return False
        state.elapsed_s = 0.0
        return True

    def look(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array) -> Mask | None:
        """Take raw readings (n, 3) each; the nodes (n,) whose offset was changed by it, None for none."""
        state = self._state
        state.newest = (state.newest + 1) % _LOOKS
        seen = state.ring[state.newest]
        seen[:, _GYR], seen[:, _ACC], seen[:, _MAG] = gyr_rad_s, acc_m_s2, mag_ut
        rate = np.add.reduce(state.ring[:, :, _GYR], axis=0) / _LOOKS
        # comparisons with NaN are false: a window that is not full is no rest
        large = np.abs(rate - state.offset).max(axis=1) > self._reach
        # the newest reading alone rules out most nodes that move
        large &= np.abs(seen[:, _GYR] - rate).max(axis=1) < _NEAR_RAD_S
        if not large.any() and not state.beyond_rad_s.any():
            state.steady[:] = 0
            return None
        return self._judge(rate, large)

    def _judge(self, rate: Array, large: Mask) -> Mask | None:
        """Look closer at nodes that read `large` (n,) mean rates (n, 3)."""
        state = self._state
        off = np.abs(state.ring[:, :, :6] - state.ring[:, :, :6].mean(axis=0)).max(axis=0)
        still = (off[:, _GYR].max(axis=1) < _NEAR_RAD_S) & (off[:, _ACC].max(axis=1) < _NEAR_M_S2)
        state.beyond_rad_s[still & ~large] = 0.0
        steady = still & (off[:, _GYR].max(axis=1) < _STEADY_RAD_S)
        state.steady = np.where(steady, state.steady + 1, 0)
        found = [i for i in np.flatnonzero(large & still).tolist() if self._rests(i, rate[i])]
        if not found:
            return None
        out = np.zeros(len(rate), dtype=np.bool_)
        for i in found:
            largest = float(np.abs(rate[i]).max())
            state.beyond_rad_s[i] = 0.0 if largest <= self._limit else largest
            out[i] = largest <= self._limit
        state.offset[out] = rate[out]
        state.steady[out] = 0
        self.some = self.some or bool(out.any())
        return out if out.any() else None

    def _rests(self, node: int, rate: Array) -> bool:
        """Whether neither gravity nor field turn, as far as they tell, while the gyro says `rate` (3,)."""
        state = self._state
        order = (np.arange(1, _LOOKS + 1) + state.newest) % _LOOKS
        seen = state.ring[order, node]
        before, after = seen[: _LOOKS // 2].mean(axis=0), seen[_LOOKS // 2 :].mean(axis=0)
        acc = before[_ACC] + after[_ACC]
        strength = float(np.linalg.norm(acc))
        if strength < 1e-6:
            return False
        up = acc / strength
        # a vector at rest in the world turns in the sensor against the sensor's own turn: dv/dt = −ω × v
        tilt = np.cross(before[_ACC], after[_ACC]) / (0.25 * strength**2 * _HALF_S)
        if float(np.linalg.norm(tilt)) > _TURNS_RAD_S:
            return False
        level = [part[_MAG] - (part[_MAG] @ up) * up for part in (before, after)]
        lengths = [float(np.linalg.norm(each)) for each in level]
        total = float(np.linalg.norm(after[_MAG]))
        if min(lengths) > 0.1 * total:
            turn = math.asin(max(-1.0, min(1.0, float(np.cross(*level) @ up) / (lengths[0] * lengths[1]))))
            along = float(rate @ up) - float(state.offset[node] @ up)
            # noise of the field may look like a slow turn, but not like most of a fast one
            return abs(turn) / _HALF_S < max(_TURNS_RAD_S, 0.4 * abs(along))
        along = abs(float((rate - state.offset[node]) @ up))
        return along < self._reach or bool(state.steady[node] >= _STEADY_LOOKS)

    def restart(self, nodes: Mask) -> None:
        """Forget the last looks at some nodes, mask (n,). An offset is the gyro's own and outlasts a loss."""
        state = self._state
        state.ring[:, nodes] = np.nan
        state.steady[nodes] = 0
