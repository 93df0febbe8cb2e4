"""One reading of an attitude instrument, for people and machines, and the span of what was read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

ANGLES = (
    "inclination",
    "magnetic_azimuth",
    "azimuth",
    "gravity_tool_face",
    "magnetic_tool_face",
    "tool_face",
)


@dataclass(frozen=True, slots=True)
class Reading:
    """Angles in rad by name, of `ANGLES`; None where an angle has no meaning; a missing name is unknown."""

    at_s: float
    """Since the start."""
    angles: dict[str, float | None]

    def as_json(self) -> dict[str, float | None]:
        """Degrees, rounded as far as they mean something."""
        return {
            "at_s": round(self.at_s, 3),
            **{
                f"{name}_deg": None if angle is None else round(math.degrees(angle), 3)
                for name, angle in self.angles.items()
            },
        }


@dataclass(slots=True)
class AngleRange:
    """From where to where an angle went, over the end of a turn too; rad."""

    first: float | None = None
    _least: float = 0.0
    _most: float = 0.0

    def add(self, angle: float | None) -> None:
        """Take the next reading."""
        if angle is None:
            return
        if self.first is None:
            self.first = angle
        past = math.remainder(angle - self.first, math.tau)
        self._least, self._most = min(self._least, past), max(self._most, past)

    @property
    def ends(self) -> tuple[float, float] | None:
        """Both ends, from -2π to 4π; None before any."""
        return None if self.first is None else (self.first + self._least, self.first + self._most)


@dataclass(slots=True)
class AttitudeLog:
    """All that was read so far."""

    readings: int = 0
    newest: Reading | None = None
    spans: dict[str, AngleRange] = field(default_factory=dict)

    def add(self, reading: Reading) -> None:
        """Take the next reading."""
        self.readings += 1
        self.newest = reading
        for name, angle in reading.angles.items():
            self.spans.setdefault(name, AngleRange()).add(angle)
