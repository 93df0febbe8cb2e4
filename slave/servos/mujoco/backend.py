"""The entry point of the simulated robot, inside the slave's process."""

from __future__ import annotations

from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import Backend, LastKnownAngles
from slave.servos.mujoco.config import MujocoConfig
from slave.servos.servos import Servos


def _open(section: MujocoConfig, skeleton: Skeleton, encoders: EncoderConfig, _: LastKnownAngles) -> Servos:
    from slave.servos.mujoco.servos import MujocoServos

    return MujocoServos(skeleton, encoders)


BACKEND = Backend(MujocoConfig, _open, remembers=False)
