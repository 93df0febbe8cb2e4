"""Nodes that give their orientation themselves: no filter, but alignment and headings as for the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import IDENTITY, Array
from common.wire.messages import Mask
from master.orientation.filter import FilterSection
from master.suit.doubt import NodeDoubt

FUSED = "fused"
"""The name that the estimator gives; no file may choose it."""


class FusedConfig(FilterSection):
    """There is nothing to choose."""

    def make(self, rate_hz: float, count: int) -> GivenOrientation:
        """For `count` nodes."""
        return GivenOrientation(count)


class GivenOrientation:
    """An `OrientationFilter` that says what it was given; its heading is the unit's, and drifts as that."""

    def __init__(self, count: int) -> None:
        self._q = np.tile(IDENTITY, (count, 1))
        self.skipped: NDArray[np.int64] = np.zeros(count, np.int64)

    def give(self, q_world_from_sensor: Array) -> None:
        """The units' orientations (n, 4) of this tick; NaN where there is none: the last one stands."""
        self._q = np.where(np.isnan(q_world_from_sensor), self._q, q_world_from_sensor)

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """The readings are not used."""

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4)."""
        return self._q.copy()

    def q_inertial_from_sensor(self) -> Array:
        """The same: what the unit did with its magnetometer is not known."""
        return self._q.copy()

    def bias_rad_s(self) -> Array:
        """None is known."""
        return np.zeros((len(self._q), 3))

    def undecided(self) -> Mask:
        """None is."""
        return np.zeros(len(self._q), np.bool_)

    def doubts(self) -> dict[int, NodeDoubt]:
        """None."""
        return {}

    @property
    def spoilt(self) -> Mask | None:
        """None is."""
        return None

    def restart(self, nodes: Mask) -> None:
        """There is no past."""
