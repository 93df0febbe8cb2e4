"""Servos that are not there: their joints stand where the file states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from common.clock import Clock, monotonic_ns
from common.errors import RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.absent.config import AbsentConfig
from slave.servos.servos import EncoderReading, check_setpoint, check_torque_limit


class AbsentServos:
    """Servos (see `slave.servos.Servos`) that move nothing. Setpoints have no effect."""

    def __init__(
        self, config: AbsentConfig, skeleton: Skeleton, encoders: EncoderConfig, clock: Clock = monotonic_ns
    ) -> None:
        self._config, self._skeleton, self._clock = config, skeleton, clock
        self._counts = Encoders(skeleton, encoders).counts(config.angles_rad(skeleton))
        self._running = False

    def start(self) -> None:
        """Nothing to open. Raises RobotError where they are started twice."""
        if self._running:
            raise RobotError("the servos run already: stop them first")
        self._running = True

    def write(self, position_rad: Array) -> None:
        """No effect. Raises ValueError if not finite or not J."""
        check_setpoint(position_rad, len(self._counts))

    def limit_torque(self, torque_nm: Array | None) -> None:
        """Nothing pushes here. See `LimitsTorque`."""
        check_torque_limit(torque_nm, len(self._counts))

    @property
    def no_torque_limit(self) -> Mapping[str, str]:
        """See `LimitsTorque`: no joint pushes harder than it may."""
        return {}

    def read(self) -> EncoderReading:
        """What encoders would show if there were any."""
        return EncoderReading(self._clock(), self._counts.copy(), np.ones(len(self._counts), np.bool_))

    def faults(self) -> Mapping[str, str]:
        """None."""
        return {}

    def quick_stop(self, stop: bool) -> None:
        """Nothing to stop."""

    def metrics(self) -> ServoMetrics:
        """Which joints are not driven."""
        return ServoMetrics(
            no_effort=self._config.no_effort(self._skeleton),
            not_driven=self._config.not_driven(self._skeleton),
        )

    def stop(self) -> None:
        """Nothing to let go of."""
        self._running = False
