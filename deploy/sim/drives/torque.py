"""The torque that drives tell: what a motor gives, as its current sensor shows it. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import build_model
from slave.servos.canopen.config import CanopenConfig

_PEAK = 3.0
"""The most that a motor gives, over its rating: usual for a servo motor."""
_NOISE, _FRICTION = 2.0, 30.0
"""Thousandths of the rating: the current sensor's, and what the gear takes while it turns."""
_LOW_PASS_S = 0.005
_SLOW_RAD_S = 0.02
"""Below this, friction grades into none."""


class ToldTorque:
    """All J drives."""

    def __init__(self, config: CanopenConfig, skeleton: Skeleton, origin_ns: int, seed: int = 0) -> None:
        drives = list(config.drives_of(skeleton).values())
        model = build_model(skeleton)
        most_nm = np.array([model.jnt_actfrcrange[model.actuator_trnid[j, 0], 1] for j in range(len(drives))])
        self._through = np.array([drive.gear_ratio * drive.gear_efficiency for drive in drives])
        self._sign = np.array([-1.0 if drive.reversed else 1.0 for drive in drives])
        self.rated_mnm: NDArray[np.int64] = np.ceil(1000.0 * most_nm / _PEAK / self._through).astype(np.int64)
        """(J,) of the motors, whole mN m as in 6076h."""
        self._random = np.random.default_rng(seed)
        self._smooth = np.zeros(len(drives))
        self._at_ns = origin_ns

    def advance(self, now_ns: int, joint_nm: Array, velocity_rad_s: Array) -> None:
        """Take in the torque at the joints (J,), as it is now."""
        motor = 1e6 * joint_nm / self._through / self.rated_mnm
        motor += _FRICTION * np.tanh(velocity_rad_s / _SLOW_RAD_S)
        share = -np.expm1(-max(0.0, to_s(now_ns - self._at_ns)) / _LOW_PASS_S)
        self._smooth += share * (motor - self._smooth)
        self._at_ns = now_ns

    def told(self) -> NDArray[np.int64]:
        """(J,) whole thousandths of the rating, in the direction of the drive's position."""
        noisy = self._sign * self._smooth + self._random.normal(0.0, _NOISE, len(self._smooth))
        return np.clip(np.rint(noisy), -32768, 32767).astype(np.int64)
