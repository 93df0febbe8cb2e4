"""Faults of the robot besides its encoders: drives, base, a namesake, contact; and its stop inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace


@dataclass(frozen=True, slots=True)
class Body:
    """The faults now. Any of them ends motion, and no engage is possible until it is gone. `stops` e-stop."""

    drives: Mapping[str, str] = field(default_factory=dict)
    """The drives' faults as text, by joint."""
    base: str | None = None
    """What is wrong with how the base stands, or None."""
    namesake: str | None = None
    """Where another robot of the same name is, or None. With two it is unknown which one is commanded."""
    stops: Mapping[str, str] = field(default_factory=dict)
    """Emergency stop inputs that are pressed or broken, by name: where each is connected, and why."""
    contact: str | None = None
    """Where the robot is pushed, or None."""
    video: str | None = None
    """Why the operator does not see what the robot does, or None."""

    def also(self, drives: Mapping[str, str]) -> Body:
        """The same with further drive faults, by joint."""
        return replace(self, drives={**drives, **self.drives}) if drives else self

    @property
    def first_fault(self) -> str | None:
        """The first fault as text, or None."""
        return self.first_besides_contact or self.contact or self.video

    @property
    def first_besides_contact(self) -> str | None:
        """The first fault other than that the robot is pushed, as text, or None."""
        return self.drive_fault or self.base or self.namesake

    @property
    def estop(self) -> str | None:
        """The emergency stop inputs that stop the robot now, as the reason of an e-stop, or None."""
        for name, why in self.stops.items():
            more = f", and {len(self.stops) - 1} more" if len(self.stops) > 1 else ""
            return f"e-stop by {name} ({why}){more}"
        return None

    @property
    def drive_fault(self) -> str | None:
        """The first drive with a fault, named, or None."""
        for joint, words in self.drives.items():
            return f"the drive of {joint}: {words}"
        return None


WELL = Body()
