"""The entry point of joints without a servo."""

from __future__ import annotations

from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.absent.config import AbsentConfig
from slave.servos.absent.servos import AbsentServos
from slave.servos.backend import Backend, LastKnownAngles
from slave.servos.servos import Servos


def _open(section: AbsentConfig, skeleton: Skeleton, encoders: EncoderConfig, _: LastKnownAngles) -> Servos:
    return AbsentServos(section, skeleton, encoders)


BACKEND = Backend(AbsentConfig, _open, remembers=False)
