"""The entry point of CiA 402 drives on CAN buses."""

from __future__ import annotations

from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import Backend, LastKnownAngles
from slave.servos.canopen.config import CanopenConfig
from slave.servos.servos import Servos


def _open(
    section: CanopenConfig, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles
) -> Servos:
    from slave.servos.canopen.servos import CanopenServos

    return CanopenServos(section, skeleton, encoders=encoders, last_known_rad=last_known_rad)


BACKEND = Backend(CanopenConfig, _open, ticked=True)
