"""Faults of the robot besides its encoders: drives, a base that tilts, another robot of the same name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Body:
    """The faults now. Any of them ends motion, and no engage is possible until it is gone."""

    drives: Mapping[str, str] = field(default_factory=dict)
    """The drives' faults as text, by joint."""
    base: str | None = None
    """What is wrong with how the base stands, or None."""
    namesake: str | None = None
    """Where another robot of the same name is, or None. With two it is unknown which one is commanded."""

    def also(self, drives: Mapping[str, str]) -> Body:
        """The same with further drive faults, by joint."""
        return Body({**drives, **self.drives}, self.base) if drives else self

    @property
    def first_fault(self) -> str | None:
        """The first fault as text, or None."""
        return self.drive_fault or self.base or self.namesake

    @property
    def drive_fault(self) -> str | None:
        """The first drive with a fault, named, or None."""
        for joint, words in self.drives.items():
            return f"the drive of {joint}: {words}"
        return None


WELL = Body()
