"""`[servos.mujoco]`: the simulated robot."""

from __future__ import annotations

from slave.servos.backend import BackendConfig


class MujocoConfig(BackendConfig):
    """The simulated robot needs no settings."""
