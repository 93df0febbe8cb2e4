"""A stop that somebody asked for, and when what of it was seen. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from common.clock import to_ns, to_s

CONFIRM_S = 1.0
"""A robot that acknowledged a stop says so in its states long before this."""


@dataclass(slots=True)
class StopShown:
    """Times are ns of this host's clock; None: not yet."""

    number: int
    by: str
    asked_ns: int
    robot_ns: int | None = None
    """When the robot had acknowledged, or a state of it said that it is stopped."""
    stands_ns: int | None = None
    """When its encoders stood, after that."""
    in_state: bool = False
    """Whether a state of the robot said since the asking that it is stopped."""
    text: str = ""
    kept: bool = True
    """Whether another process goes on asking, should the console die before the robot has acknowledged."""
    failed: str = ""
    """Why nobody knows that it stopped, in words."""

    def unconfirmed(self, now_ns: int) -> bool:
        """Whether the robot acknowledged it long ago, and no state has told of it since."""
        return self.robot_ns is not None and not self.in_state and now_ns - self.robot_ns > to_ns(CONFIRM_S)

    def shown(self, now_ns: int) -> dict[str, object]:
        """As the page has it."""
        return {
            "id": self.number,
            "by": self.by,
            "since_s": round(to_s(now_ns - self.asked_ns), 3),
            "text": self.text,
            **self.lights(),
        }

    def lights(self) -> dict[str, object]:
        """What became of it, without who asked: seconds after the asking, or why nobody knows."""
        return {
            "asked_s": 0.0,
            "robot_s": self._after(self.robot_ns),
            "stands_s": self._after(self.stands_ns),
            "failed": self.failed,
        }

    def _after(self, at_ns: int | None) -> float | None:
        return None if at_ns is None else round(to_s(at_ns - self.asked_ns), 3)
