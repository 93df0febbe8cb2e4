"""What every servo backend's section of the configuration answers besides its own settings."""

from __future__ import annotations

from common.config.section import Section
from common.errors import ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig


class BackendConfig(Section):
    """`[servos.<name>]`: base of every backend's section. The names stand in `slave/backends.py`."""

    @property
    def bus_lag_s(self) -> float:
        """Mean delay of a setpoint on its way to the drives, s; `predict` aims ahead by it."""
        return 0.0

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints whose effort nothing will tell, as far as the file says, and why."""
        return {}

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """What does not fit the robot. Asked only where the file chooses this backend."""
        return []
