"""What every source of an emergency stop input can do: tell the level of one contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Level:
    """The newest reading of one contact."""

    read_ns: int
    """When it was read, ns of the slave's clock."""
    on: bool | None
    """A line is high, a key is down, a bit is set; None where nobody can know, because of `why`."""
    why: str = ""
    """What keeps it from being known, or what the source itself says of it."""
    changed_ns: int = 0
    """When it changed last, however shortly; 0: not since it is known."""


class StopSource(Protocol):
    """One contact as the slave sees it. Only `start` and `stop` may block.

    `start` does not fail: a source that cannot be opened says so by its level, which stops the robot, and is
    tried again once a second.
    """

    def start(self) -> None:
        """Open it, and read it once."""
        ...

    def read(self) -> Level:
        """The newest reading. Never blocks."""
        ...

    def stop(self) -> None:
        """Let go of it. Safe to call twice."""
        ...
