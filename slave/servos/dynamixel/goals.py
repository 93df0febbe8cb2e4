"""Where each servo is sent in this cycle: its setpoint, once it has joined it slowly. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import RAD_PER_COUNT, Counts, Encoders
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.settings import Settings


class ServoGoals:
    """The goals of all J servos, counts."""

    def __init__(
        self, config: DynamixelConfig, skeleton: Skeleton, encoders: Encoders, servos: Sequence[Settings]
    ) -> None:
        self._skeleton = skeleton
        self._encoders = encoders
        self._step = max(1, round(config.rejoin_velocity_rad_s / RAD_PER_COUNT / config.rate_hz))
        self._lowest: Counts = np.array([servo.lowest for servo in servos])
        self._highest: Counts = np.array([servo.highest for servo in servos])
        self._rejoining = np.zeros(len(servos), np.bool_)
        self._stopping = False
        self.counts: Counts = np.zeros(len(servos), np.int64)
        """(J,) the newest goals. The goal of a servo with a fault is never written."""

    def rejoin(self, servo: int | slice = slice(None)) -> None:
        """Move one servo, or all, slowly until it is at its setpoint."""
        self._rejoining[servo] = True

    def aim(self, setpoint_rad: Array | None, stop: bool, stands: Counts) -> None:
        """Move the goals towards setpoints (J,); `stop`: hold where the servos stand (J,) from now on."""
        if stop:
            if not self._stopping:
                self.counts[:] = np.clip(stands, self._lowest, self._highest)
            self.rejoin()
        elif setpoint_rad is not None:
            limited = np.clip(setpoint_rad, self._skeleton.lower_rad, self._skeleton.upper_rad)
            way = self._encoders.counts(limited) - self.counts
            self._rejoining &= np.abs(way) > self._step
            slow = np.clip(way, -self._step, self._step)
            self.counts += np.where(self._rejoining, slow, way)
        self._stopping = stop
