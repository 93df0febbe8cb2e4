"""The servos that the configuration names."""

from __future__ import annotations

from collections.abc import Mapping

from common.errors import RobotError
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.config import ServosConfig
from slave.servos.servos import Servos


def open_servos(
    config: ServosConfig,
    skeleton: Skeleton,
    encoders: EncoderConfig,
    last_known_rad: Mapping[str, float] | None = None,
) -> Servos:
    """Servos that have not been started yet; `last_known_rad`: where joints stood when last seen.

    Raises RobotError where they cannot be had.
    """
    match config.backend:
        case "mujoco":
            # imported here: a robot of metal needs no simulator
            from slave.servos.mujoco import MujocoServos

            return MujocoServos(skeleton, encoders)
        case "canopen":
            from slave.servos.canopen.servos import CanopenServos

            return CanopenServos(config.canopen, skeleton, encoders=encoders, last_known_rad=last_known_rad)
        case "dynamixel":
            from slave.servos.dynamixel.servos import DynamixelServos

            if config.dynamixel is None:
                raise RobotError("servos.dynamixel is not set: a section with port and ids is needed")
            return DynamixelServos(config.dynamixel, skeleton, encoders)
