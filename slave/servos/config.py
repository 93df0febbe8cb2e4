"""`[servos]`: which robot the slave drives."""

from __future__ import annotations

from typing import Literal

from common.config.section import Section
from common.errors import NOT_SET, ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.dynamixel.config import DynamixelConfig


class ServosConfig(Section):
    """`[servos]` of the slave's TOML."""

    backend: Literal["mujoco", "canopen", "dynamixel"] = "mujoco"
    """`mujoco`: the simulated robot, inside the slave's process. `canopen`: CiA 402 drives on CAN buses.
    `dynamixel`: X series servos on a serial bus.
    """
    canopen: CanopenConfig = CanopenConfig()
    dynamixel: DynamixelConfig | None = None

    @property
    def single_reading(self) -> bool:
        """Whether a joint's angle is read by nothing but its servo, so that nothing can contradict it."""
        return self.backend == "dynamixel"

    @property
    def remembers(self) -> bool:
        """Whether to keep on disk where the joints stood: a simulated robot begins anew each time."""
        return self.backend != "mujoco"

    @property
    def bus_lag_s(self) -> float:
        """How much later than at once a setpoint takes full effect on the way to the drives, on average."""
        # it waits half a SYNC period, and the drives take a whole one to go there in a straight line
        return 1.5 / self.canopen.sync_hz if self.backend == "canopen" else 0.0

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """What the chosen backend cannot be built from."""
        match self.backend:
            case "mujoco":
                return []
            case "canopen":
                return self.canopen.mistakes_for(skeleton)
            case "dynamixel":
                if self.dynamixel is None:
                    return [ConfigMistake("servos.dynamixel", NOT_SET, "a section with port and ids")]
                return self.dynamixel.mistakes_for(skeleton, encoders)
