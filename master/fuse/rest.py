"""Whether a node lies still, so that what its gyro reads is its bias."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.messages import Mask
from common.quaternion import Array

_TAU_S = 0.5
_NEAR_RAD_S, _NEAR_M_S2 = np.radians(2.0), 0.5
_LARGEST_BIAS_RAD_S = np.radians(6.0)
_AFTER_S = 1.5


@dataclass(slots=True)
class RestState:
    """n nodes; NaN where a node has yet to start."""

    gyr_rad_s: Array
    """Low-passed (n, 3)."""
    acc_m_s2: Array
    """Low-passed (n, 3)."""
    still_s: Array
    """For how long nothing has moved (n,)."""

    def forget(self, nodes: Mask) -> None:
        """Start some nodes anew, mask (n,)."""
        self.gyr_rad_s[nodes] = np.nan


class Rest:
    """Still is a node whose gyro and accelerometer stay near their own low-passed values for a while.

    Thresholds as VQF has them: 2 °/s and 0.5 m/s² for 1.5 s. A steady turn slower than 6 °/s looks like
    rest to any such test; faster ones are told apart by that bound.
    """

    def start(self, count: int) -> RestState:
        """State of that many nodes that have yet to start."""
        return RestState(np.full((count, 3), np.nan), np.zeros((count, 3)), np.zeros(count))

    def update(self, state: RestState, gyr_rad_s: Array, acc_m_s2: Array, dt_s: float) -> Mask:
        """Take one tick (n, 3) each; who has been still for long enough, (n,)."""
        new = np.isnan(state.gyr_rad_s[:, 0])
        if new.any():
            state.gyr_rad_s[new], state.acc_m_s2[new], state.still_s[new] = gyr_rad_s[new], acc_m_s2[new], 0.0
        share = dt_s / (_TAU_S + dt_s)
        gyr_off, acc_off = gyr_rad_s - state.gyr_rad_s, acc_m_s2 - state.acc_m_s2
        state.gyr_rad_s += share * gyr_off
        state.acc_m_s2 += share * acc_off
        near = (
            (np.einsum("ni,ni->n", gyr_off, gyr_off) < _NEAR_RAD_S**2)
            & (np.einsum("ni,ni->n", acc_off, acc_off) < _NEAR_M_S2**2)
            & (np.abs(state.gyr_rad_s).max(axis=1) < _LARGEST_BIAS_RAD_S)
        )
        state.still_s = np.where(near, state.still_s + dt_s, 0.0)
        out: Mask = state.still_s > _AFTER_S
        return out
