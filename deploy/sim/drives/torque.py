"""The torque that drives tell: what a motor gave since the last SYNC, by its current sensor. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import build_model
from slave.servos.canopen.config import CanopenConfig

_PEAK = 3.0
"""The most that a motor gives, over its rating: usual for a servo motor."""
_NOISE, _FRICTION = 2.0, 30.0
"""Thousandths of the rating: the current sensor's, and what the gear takes while it turns."""
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
        self.limit_nm: Array = np.stack((np.full(len(drives), -np.inf), np.full(len(drives), np.inf)))
        """(2, J) what the drives have been told that their motors may give, N m at the joint."""
        self._random = np.random.default_rng(seed)
        self._apart_ns = config.period_ns // 2
        self._latched_ns = origin_ns
        self._sum, self._count = np.zeros(len(drives)), 0
        self.thousandths: NDArray[np.int64] = np.zeros(len(drives), np.int64)
        """(J,) of the rating, in the direction of its position: the mean between the last two SYNCs."""

    def take(self, joint_nm: Array, velocity_rad_s: Array) -> None:
        """Take in the torque at the joints (J,) of one more cycle."""
        motor = 1e6 * joint_nm / self._through / self.rated_mnm
        self._sum += motor + _FRICTION * np.tanh(velocity_rad_s / _SLOW_RAD_S)
        self._count += 1

    def limit(self, drive: int, thousandths: Mapping[str, int]) -> None:
        """What one drive has been told: `positive_limit`, `negative_limit` and `max_torque`, where it was."""
        through_nm = 1e-6 * float(self.rated_mnm[drive]) * float(self._through[drive])
        most = thousandths.get("max_torque", math.inf)
        up = through_nm * min(thousandths.get("positive_limit", math.inf), most)
        down = through_nm * min(thousandths.get("negative_limit", math.inf), most)
        self.limit_nm[:, drive] = (-down, up) if self._sign[drive] > 0.0 else (-up, down)

    def latch(self, now_ns: int) -> None:
        """A SYNC has come, or the same one on another bus."""
        if not self._count or now_ns - self._latched_ns < self._apart_ns:
            return
        mean = self._sign * self._sum / self._count
        noisy = mean + self._random.normal(0.0, _NOISE, len(mean))
        self.thousandths = np.clip(np.rint(noisy), -32768, 32767).astype(np.int64)
        self._latched_ns, self._sum, self._count = now_ns, np.zeros(len(mean)), 0
