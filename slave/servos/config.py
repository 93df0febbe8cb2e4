"""`[servos]`: which robot the slave drives."""

from __future__ import annotations

from typing import Literal

from common.config import Section
from common.errors import ConfigMistake
from common.skeleton import Skeleton
from slave.servos.canopen.config import CanopenConfig


class ServosConfig(Section):
    """`[servos]` of the slave's TOML."""

    backend: Literal["mujoco", "canopen"] = "mujoco"
    """`mujoco`: the simulated robot, inside the slave's process. `canopen`: CiA 402 drives on CAN buses."""
    canopen: CanopenConfig = CanopenConfig()

    def mistakes_for(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """What the chosen backend cannot be built from."""
        return self.canopen.mistakes_for(skeleton) if self.backend == "canopen" else []
