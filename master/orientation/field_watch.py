"""A magnetometer that changes while it is worn: iron put near it, a magnet met, a scale that jumped.

The earth's field has one strength and one dip however a sensor turns. Iron that sticks to a sensor turns with
it, so that strength and dip vary with the attitude, or jump. What both have been since the node's start is
the reference. Where all nodes differ from theirs alike, the operator has walked elsewhere and the references
follow. A change that leaves strength and dip as they are, as of a small field across the earth's, cannot be
noticed so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, rotate
from common.wire.messages import Mask

_REFERENCE_S = 60.0
"""Time constant with which a reference follows, and the time over which it is a plain mean at first."""
_COMMON_S = 5.0
"""Time constant with which all references follow what all nodes see alike."""
_WINDOW_S = 3.0
"""Time constant of the mean by which a node is judged."""
_FIRST_S = 5.0
"""No node is judged before this time after its start."""
_LEAVE = 0.6
"""Of the threshold: below it a doubted field is believed again."""
_DIP_DEG = 100.0
"""Times the share is how far the dip may be off, 10° beside 10 % of strength, as in VQF."""
_LEAST_SUIT = 4
"""Nodes with a field from which on what they have in common is the place's, not theirs."""


@dataclass(slots=True)
class _FieldState:
    """n nodes."""

    reference: Array
    """Strength, and dip in degrees (n, 2); NaN before the first field."""
    now: Array
    """The same of the last look (n, 2)."""
    off: Array
    """Mean square deviation, 1 at the threshold (n,)."""
    age_s: Array
    """Since the first field (n,)."""
    doubted: Mask


class FieldWatch:
    """Judges the fields of n nodes."""

    def __init__(self, share: float, count: int) -> None:
        """`share`: how much strength may change, 0 to watch nothing."""
        self.share = share
        self._state = _FieldState(
            reference=np.full((count, 2), np.nan),
            now=np.full((count, 2), np.nan),
            off=np.zeros(count),
            age_s=np.zeros(count),
            doubted=np.zeros(count, dtype=np.bool_),
        )
        self.unusual: Mask = np.zeros(count, dtype=np.bool_)
        """(n,) whose field was beyond the threshold in the last look, for however short."""

    @property
    def doubted(self) -> Mask:
        """(n,) whose field is not what it was."""
        return self._state.doubted

    def look(self, mag: Array, magnetic: Mask, q_inertial_from_sensor: Array, dt_s: float) -> None:
        """Take fields (n, 3) of those that have one, `magnetic` (n,), `dt_s` after the look before."""
        if self.share <= 0.0 or not magnetic.any():
            return
        state = self._state
        world = rotate(q_inertial_from_sensor, mag)
        level = np.hypot(world[:, 0], world[:, 1])
        state.now[:, 0] = np.hypot(level, world[:, 2])
        state.now[:, 1] = np.degrees(np.arctan2(-world[:, 2], level))
        seen = magnetic & (state.now[:, 0] > 0.0)
        new = seen & np.isnan(state.reference[:, 0])
        state.reference[new] = state.now[new]
        state.age_s[seen] += dt_s
        change = state.now - state.reference
        change[:, 0] /= state.reference[:, 0]
        if np.count_nonzero(seen) >= _LEAST_SUIT:
            common = np.median(change[seen], axis=0)
            change -= common
            step = min(1.0, dt_s / _COMMON_S) * common
            state.reference[:, 0] *= 1.0 + step[0]
            state.reference[:, 1] += step[1]
        square = (change[:, 0] / self.share) ** 2 + (change[:, 1] / (_DIP_DEG * self.share)) ** 2
        self.unusual = seen & (square > 1.0) & (state.age_s > _FIRST_S)
        judged = seen & (state.age_s > _FIRST_S)
        state.off[judged] += min(1.0, dt_s / _WINDOW_S) * (square - state.off)[judged]
        state.doubted = state.off > np.where(state.doubted, _LEAVE, 1.0)
        follow = seen & ~state.doubted
        step = dt_s / np.clip(state.age_s[follow], dt_s, _REFERENCE_S)
        state.reference[follow] += step[:, None] * (state.now - state.reference)[follow]

    def words(self, node: int) -> str:
        """What is said of a doubted node."""
        now, before = self._state.now[node], self._state.reference[node]
        return (
            f"its magnetic field is {now[0]:.0f} µT at a dip of {now[1]:.0f}°, it was {before[0]:.0f} at "
            f"{before[1]:.0f}°: its heading goes by the gyroscope; look for iron near it, or calibrate it"
        )

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""
        state = self._state
        state.reference[nodes] = np.nan
        state.off[nodes] = state.age_s[nodes] = 0.0
        state.doubted[nodes] = False
