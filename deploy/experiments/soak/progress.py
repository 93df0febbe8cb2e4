"""How far a soak is, for the screen."""

from __future__ import annotations

from dataclasses import dataclass, field

from deploy.experiments.soak.schedule import PlannedFault


@dataclass(slots=True)
class SoakProgress:
    """The plan, and what is being done now."""

    duration_s: float
    began_s: float | None = None
    """When the robot first followed, seconds of the soak."""
    planned: list[PlannedFault] = field(default_factory=list)
    next: int = 0
    busy: str = "starting"
    """What is being done; empty while nothing is."""
