"""What every sensor of the base's attitude can do."""

from __future__ import annotations

from typing import Protocol

from common.wire.messages import BaseAttitude


class BaseSensor(Protocol):
    """The base's attitude as the slave sees it. Only `start` and `stop` may block."""

    def start(self) -> None:
        """Open it. Raises RobotError where that fails."""
        ...

    def read(self) -> BaseAttitude | None:
        """The newest reading, None before the first; `measured_ns` is its time. Never blocks."""
        ...

    def counters(self) -> dict[str, int]:
        """What came and what could not be used."""
        ...

    def stop(self) -> None:
        """Let go of it. Safe to call twice."""
        ...
