"""What a servo backend is: its section of the configuration, and what makes its servos.

A package adds a backend by an entry point of the group `tandem.servos` that names a `Backend`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from common.config.section import Section
from common.errors import ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.servos import Servos

LastKnownAngles = Mapping[str, float]
"""The joints' last known angles, rad, by joint."""


class BackendConfig(Section):
    """`[servos.<name>]`: base of every backend's section.

    A backend drives some of the robot's joints or all of them. `skeleton` has only those.
    """

    @property
    def bus_lag_s(self) -> float:
        """Mean delay of a setpoint on its way to the drives, s; `predict` aims ahead by it."""
        return 0.0

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints whose effort nothing will tell, as far as the file says, and why."""
        return {}

    def single_reading(self, skeleton: Skeleton) -> Collection[str]:
        """Joints whose angle one encoder alone tells, so that no second one can contradict it."""
        return ()

    def not_driven(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints that this backend does not move, and what their angle is, in words."""
        return {}

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """What does not fit the robot. Asked only where the file chooses this backend."""
        return []


Chosen = TypeVar("Chosen", bound=BackendConfig)


@dataclass(frozen=True, slots=True)
class Backend(Generic[Chosen]):
    """One kind of servo."""

    section: type[Chosen]
    """Its section `[servos.<name>]`."""
    open: Callable[[Chosen, Skeleton, EncoderConfig, LastKnownAngles], Servos]
    """Makes the servos. Import the adapter in this function: other robots do not need its library."""
    remembers: bool = True
    """Whether the slave keeps the joints' last angles on disk; not for a simulated robot."""
    ticked: bool = False
    """Whether its drives stop by themselves without the slave's ticks: it is started last."""
