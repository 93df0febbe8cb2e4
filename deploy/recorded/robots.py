"""Which robot a recorded message is of: a master's recording holds all that it commands."""

from __future__ import annotations


def robot_of(topic: str) -> str:
    """The robot of a topic such as tandem/robot-1/state; empty for a process's own, such as suit/frames."""
    parts = topic.split("/")
    return parts[1] if parts[0] == "tandem" and len(parts) > 2 else ""
