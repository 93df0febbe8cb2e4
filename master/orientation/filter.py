"""The interface of an orientation filter and of its section in the configuration."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from common.config.section import Section
from common.quaternion import Array
from common.wire.messages import Mask
from master.suit.doubt import NodeDoubt


class OrientationFilter(Protocol):
    """Estimates the orientations of n nodes at once from their calibrated readings, one tick at a time."""

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """Take one tick's readings, (n, 3) each, sensor frame. A NaN row of `mag_ut` has no magnetometer.

        `dt_s` is the time since the update before, None for the nominal period. A node's first readings
        after its start set its orientation at once.
        """

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4), world east-north-up; heading arbitrary without a magnetometer."""

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (n, 4) without the magnetometer: upright by gravity, heading by the gyro alone.

        They differ from `q_world_from_sensor` by a turn about the vertical, whose angle drifts slowly.
        """

    def bias_rad_s(self) -> Array:
        """The gyros' bias as estimated, (n, 3): the true rate is the reading minus this."""

    def undecided(self) -> Mask:
        """(n,) nodes whose steady rate may be a bias not learnt yet; it says nothing of the motion."""

    def doubts(self) -> dict[int, NodeDoubt]:
        """Doubts about nodes, by their number."""

    @property
    def spoilt(self) -> Mask | None:
        """(n,) nodes with an unusable reading in the last update; None where no node had one."""

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(n,) ticks with an unusable reading (NaN, infinite, absurd), which was left out."""

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""


class FilterSection(Section):
    """`[estimation.<name>]`: the parameters of one filter, each with a default, and its maker."""

    @abstractmethod
    def make(self, rate_hz: float, count: int) -> OrientationFilter:
        """The filter for `count` nodes whose readings come at `rate_hz`."""
