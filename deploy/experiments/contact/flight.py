"""One motion through the air, by one kind of readings and one load. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from deploy.sim.patient.replay import Lap


@dataclass(frozen=True, slots=True)
class Flight:
    """One motion, again and again, by one kind of readings and one load."""

    motion: str
    readings: str
    load: str
    laps: tuple[Lap, ...]

    @property
    def seconds(self) -> float:
        """Together."""
        return sum(lap.seconds for lap in self.laps)

    @property
    def findings(self) -> tuple[str, ...]:
        """The words of each that would have been a stop."""
        return tuple(words for lap in self.laps for words in lap.findings)

    @property
    def worst(self) -> Lap:
        """The one that came nearest to a threshold."""
        return max(self.laps, key=lambda lap: lap.nearest)
