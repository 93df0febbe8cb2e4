"""Where each drive is sent with the next SYNC: its setpoint, once it has joined it slowly. Pure."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.units import DriveUnits


class DriveTargets:
    """The targets of all J drives. A drive that does not run is sent where it stands."""

    def __init__(self, config: CanopenConfig, units: DriveUnits) -> None:
        self._units = units
        self._step_rad = math.radians(config.join_deg_s) / config.sync_hz
        self._joined: Mask = np.zeros(len(units.scale), np.bool_)
        self.target_rad: Array = np.zeros(len(units.scale))
        """(J,) the newest."""

    def step(
        self, setpoint_rad: Array | None, position: NDArray[np.int32], running: Mask
    ) -> NDArray[np.int32]:
        """(J,) increments for drives that stand at `position` (J,) and are `running` (J,)."""
        stands_rad = self._units.angle_rad(position)
        idle = ~running
        self._joined[idle] = False
        if setpoint_rad is None:
            self.target_rad = np.where(idle, stands_rad, self.target_rad)
        elif self._joined.all():
            self.target_rad = setpoint_rad
        else:
            way = setpoint_rad - self.target_rad
            towards = self.target_rad + np.clip(way, -self._step_rad, self._step_rad)
            self._joined |= running & (np.abs(way) <= self._step_rad)
            self.target_rad = np.where(idle, stands_rad, np.where(self._joined, setpoint_rad, towards))
        return np.where(idle, position, self._units.increments(self.target_rad)).astype(np.int32)
