"""Whether a node lies still, so that what its gyro reads is its bias."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

_TAU_S = 0.5
_NEAR_RAD_S, _NEAR_M_S2 = np.radians(2.0), 0.5
_LARGEST_BIAS_RAD_S = np.radians(2.0)
_AFTER_S = 1.5
_SHARES: Array = np.repeat([[_NEAR_RAD_S**-2, 0.0], [0.0, _NEAR_M_S2**-2]], 3, axis=0)
"""Squares (n, 6) times this: how far gyro and accelerometer are off, as shares of the thresholds squared."""


@dataclass(slots=True)
class RestState:
    """n nodes; NaN where a node has yet to start."""

    low: Array
    """Low-passed (n, 6): gyro, rad/s, then accelerometer, m/s²."""
    still_s: Array
    """For how long nothing has moved (n,)."""

    def gyr_rad_s(self) -> Array:
        """Low-passed (n, 3): the bias of nodes that lie still."""
        return self.low[:, :3]

    def forget(self, nodes: Mask) -> None:
        """Start some nodes anew, mask (n,)."""
        self.low[nodes] = np.nan


class Rest:
    """Still is a node whose gyro and accelerometer stay near their own low-passed values for a while.

    Thresholds as VQF has them: 2 °/s and 0.5 m/s² for 1.5 s. To any such test a steady turn looks like
    rest; turns beyond 2 °/s are told apart by their rate, and a larger bias is left to `gross_bias.py`.
    """

    def start(self, count: int) -> RestState:
        """State of that many nodes that have yet to start."""
        return RestState(np.full((count, 6), np.nan), np.zeros(count))

    def update(self, state: RestState, gyr_rad_s: Array, acc_m_s2: Array, dt_s: float) -> Mask:
        """Take one tick, (n, 3) each; which nodes have been still for long enough, (n,)."""
        readings = np.concatenate([gyr_rad_s, acc_m_s2], axis=1)
        new = np.isnan(state.low[:, 0])
        if new.any():
            state.low[new], state.still_s[new] = readings[new], 0.0
        readings -= state.low
        state.low += (dt_s / (_TAU_S + dt_s)) * readings
        readings *= readings
        near = (readings @ _SHARES).max(axis=1) < 1.0
        near &= np.abs(state.gyr_rad_s()).max(axis=1) < _LARGEST_BIAS_RAD_S
        state.still_s += dt_s
        state.still_s *= near
        out: Mask = state.still_s > _AFTER_S
        return out
