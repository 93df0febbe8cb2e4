"""The emergency stop inputs of one robot, opened: what the servo loop asks in every tick."""

from __future__ import annotations

from collections.abc import Mapping

from common.clock import Clock, monotonic_ns
from slave.servos import Servos
from slave.servos.signs import TellingServos
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.drive import DriveStop
from slave.stop_inputs.rule import StopInputs
from slave.stop_inputs.source import StopSource


class RobotStops:
    """Each input's source, and the rule."""

    def __init__(self, config: EstopConfig, servos: Servos | None, clock: Clock = monotonic_ns) -> None:
        """`servos`: those whose drives tell inputs. Raises ModuleNotFoundError for a missing library."""
        self._sources = [source_of(one, servos, clock) for one in config.inputs]
        self._rule = StopInputs(config)

    def start(self) -> None:
        """Open each one that can be opened; the others stop the robot, and are tried again once a second."""
        for source in self._sources:
            source.start()

    def read(self, now_ns: int) -> Mapping[str, str]:
        """Inputs that stop the robot now, by name: where and why. Never blocks."""
        return self._rule.step(now_ns, [source.read() for source in self._sources])

    def stop(self) -> None:
        """Let go of them."""
        for source in self._sources:
            source.stop()


def source_of(config: StopInputConfig, servos: Servos | None, clock: Clock = monotonic_ns) -> StopSource:
    """The source of one input, not started. `servos`: those whose drives tell it."""
    if config.source in ("drive", "sto"):
        assert isinstance(servos, TellingServos), "the file was checked"
        return DriveStop(config, servos.signs)
    # imported here: each needs a library that other robots do not have
    if config.source == "device":
        from slave.stop_inputs.device import DeviceStop

        return DeviceStop(config, clock=clock)
    from slave.stop_inputs.gpio import GpioStop

    return GpioStop(config, clock)
