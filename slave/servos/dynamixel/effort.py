"""The torque of each servo, from the current that it tells. Pure.

ROBOTIS e-Manual, "Present Current" and "Present Load" of each model: one address, three meanings.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.encoders.counts import EncoderConfig
from slave.servos.dynamixel.config import DynamixelConfig

_UNIT_A = 2.69e-3
_SMALL_UNIT_A = 1e-3
_SMALL = frozenset({1190, 1200, 1210, 1220, 1230, 1240})
"""XL330 and XC330."""
_TELL_LOAD = frozenset({1060, 1070, 1080, 1090, 1160})
"""XL430, 2XL430, XC430, 2XC430: they have no current sensor, and tell their share of the voltage there."""


class ServoEfforts:
    """The servos of all J joints."""

    def __init__(self, config: DynamixelConfig, skeleton: Skeleton, encoders: EncoderConfig) -> None:
        names = skeleton.joint_names
        self._names = names
        self._per_a = np.array([config.torque_nm_a.get(name, np.nan) for name in names])
        self._per_a[[name in encoders.reversed for name in names]] *= -1.0
        self._scale_nm = np.full(len(names), np.nan)
        self.missing: dict[str, str] = config.no_effort(skeleton)
        """Why the effort of a joint is not known, by joint."""

    def know(self, models: Mapping[str, int]) -> None:
        """The model numbers of the servos, by joint."""
        for j, name in enumerate(self._names):
            model = models[name]
            if model in _TELL_LOAD:
                self.missing[name] = f"its servo (model {model}) measures no current"
            else:
                self._scale_nm[j] = self._per_a[j] * (_SMALL_UNIT_A if model in _SMALL else _UNIT_A)

    def joint_nm(self, currents: NDArray[np.int64], valid: Mask) -> Array | None:
        """(J,) N m at the joint from currents (J,) in the servos' units; None where no servo tells any."""
        if np.isnan(self._scale_nm).all():
            return None
        out: Array = np.where(valid, self._scale_nm * currents, np.nan)
        return out
