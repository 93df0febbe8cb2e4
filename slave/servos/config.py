"""`[servos]`: which robot the slave drives."""

from __future__ import annotations

from typing import Literal

from common.config import Section


class ServosConfig(Section):
    """`[servos]` of the slave's TOML."""

    backend: Literal["mujoco"] = "mujoco"
    """`mujoco`: the simulated robot, inside the slave's process."""
