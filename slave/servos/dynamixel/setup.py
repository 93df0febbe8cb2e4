"""`tandem servos`: look at each servo, and replace its lasting settings when a person asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.bus import Bus, ServoError
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.lasting import Difference, replace, support
from slave.servos.dynamixel.port import Port
from slave.servos.dynamixel.settings import Settings, settings_of
from slave.servos.dynamixel.startup import inspect, know

_PATIENCE_S = 0.05


@dataclass(frozen=True, slots=True)
class Looked:
    """At one servo."""

    servo: Settings
    different: tuple[Difference, ...] = ()
    """What it kept that had to be replaced, as it was found."""
    wrong: str = ""
    """Why it cannot be used, or its registers not be replaced; empty where it can."""
    written: bool = False


@dataclass(frozen=True, slots=True)
class SetUp:
    """All servos of one bus."""

    servos: tuple[Looked, ...]
    quickest_s: float
    """The quickest answer; 0 where none came."""


def set_up(
    config: DynamixelConfig,
    skeleton: Skeleton,
    encoders: EncoderConfig,
    write: bool = False,
    open_port: Callable[[str, int, float], Port] = Port,
) -> SetUp:
    """Look at every servo; with `write`, and only where none is refused, replace what differs.

    Raises PortLostError.
    """
    bus = Bus(open_port(config.port, config.baud, config.reply_timeout_s))
    try:
        with bus.patient(_PATIENCE_S):
            found = [
                _look(bus, servo) for servo in settings_of(config, skeleton, Encoders(skeleton, encoders))
            ]
            if write and not any(looked.wrong for looked in found):
                found = [_write(bus, looked) for looked in found]
            return SetUp(tuple(found), bus.quickest_s)
    finally:
        bus.close()


def _look(bus: Bus, servo: Settings) -> Looked:
    try:
        different = know(bus, servo)
        if not different:
            inspect(bus, servo)
        elif bus.read(servo.id, x.TORQUE):
            return Looked(servo, tuple(different), support(different))
    except ServoError as error:
        return Looked(servo, wrong=str(error))
    return Looked(servo, tuple(different))


def _write(bus: Bus, looked: Looked) -> Looked:
    servo, different = looked.servo, looked.different
    try:
        replace(bus, servo, different)
        inspect(bus, servo)
    except ServoError as error:
        return Looked(servo, different, str(error), written=bool(different))
    return Looked(servo, different, written=bool(different))
