"""The entry point of X series servos on a serial bus."""

from __future__ import annotations

from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import Backend, LastKnownAngles
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.servos import Servos


def _open(
    section: DynamixelConfig, skeleton: Skeleton, encoders: EncoderConfig, _: LastKnownAngles
) -> Servos:
    from slave.servos.dynamixel.servos import DynamixelServos

    return DynamixelServos(section, skeleton, encoders)


BACKEND = Backend(DynamixelConfig, _open)
