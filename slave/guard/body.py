"""What is amiss with the robot besides its encoders: drives, a base that tilts, another of its name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Body:
    """Of this moment. Whatever is amiss ends motion, and nothing engages until it is mended."""

    drives: Mapping[str, str] = field(default_factory=dict)
    """What is wrong with a joint's drive, in words, by joint; empty where all are well."""
    base: str | None = None
    """What is wrong with how the base stands, or None."""
    namesake: str | None = None
    """Where another robot of the same name is, or None: nobody knows then which of the two he commands."""

    def also(self, drives: Mapping[str, str]) -> Body:
        """The same body, and what else is wrong with drives, by joint."""
        return Body({**drives, **self.drives}, self.base) if drives else self

    @property
    def amiss(self) -> str | None:
        """The first thing that is wrong, in words, or None."""
        return self.drive_fault or self.base or self.namesake

    @property
    def drive_fault(self) -> str | None:
        """The first drive that is not well, named, or None."""
        for joint, words in self.drives.items():
            return f"the drive of {joint}: {words}"
        return None


WELL = Body()
