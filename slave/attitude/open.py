"""The base's sensor that the configuration names."""

from __future__ import annotations

from common.clock import Clock, monotonic_ns
from slave.attitude.config import BaseConfig
from slave.attitude.sensor import BaseSensor


def open_base(config: BaseConfig, clock: Clock = monotonic_ns) -> BaseSensor | None:
    """A sensor that has not been started yet, None where the base carries none. Raises ConfigError."""
    match config.source:
        case "none":
            return None
        case "serial":
            # imported here: only a serial port needs pyserial
            from slave.attitude.port import SerialBase

            return SerialBase(config, clock)
        case "simulated":
            from slave.attitude.simulated_base import SimulatedBase

            return SimulatedBase(config, clock)
