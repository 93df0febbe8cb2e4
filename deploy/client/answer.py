"""What came of a person's request to one robot."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RobotAnswer:
    """What came of a request to one robot."""

    robot: str
    done: bool
    text: str
    """What happened, or why not."""
    guard: str = ""
    """The guard's state; empty where the robot did not answer."""
    instance: int = 0
    """Which process answered; 0 where it did not tell."""
    place: str = ""
    """Where that process is; empty where it did not tell, or where it is the only one of its name."""

    @property
    def line(self) -> str:
        """For people."""
        name = f"{self.robot} ({self.place})" if self.place else self.robot
        return ": ".join(part for part in (name, self.guard, self.text) if part)
