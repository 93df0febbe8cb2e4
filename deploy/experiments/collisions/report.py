"""What a run of random motions found: adds up over its parts, in any order. Pure."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

SLACK_M = 0.002
TICK_US = [1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 400, 500, 700, 1000, 1400, 2000, 3000,
           5000, 7000, 10_000, 20_000, 50_000, 100_000]  # fmt: skip
"""Upper edges of the histogram of a step's CPU time."""


@dataclass(slots=True)
class CollisionReport:
    """What was found."""

    kinds: Counter[str] = field(default_factory=Counter)
    """Motions made, by kind."""
    ticks: int = 0
    held_back: int = 0
    """Ticks in which a joint was held back."""
    spare_m: dict[str, float] = field(default_factory=dict)
    """The least distance less its margin, of the robot itself and of each zone that keeps one."""
    beyond_limits: int = 0
    stops: int = 0
    """Times that the line died, and the robot braked to standstill."""
    stuck: int = 0
    """Times that the robot did not come home within 4 s of the operator, straight from where he was."""
    trapped: int = 0
    """Of those, times that it did not come home either when it was led back the way it had come."""
    tick_us: list[int] = field(default_factory=lambda: [0] * len(TICK_US))
    """Some steps of the limiter by their CPU time, in `TICK_US`."""

    @property
    def motions(self) -> int:
        """Made."""
        return self.kinds.total()

    def came(self, what: str, spare_m: float) -> None:
        """Something was this far beyond its margin."""
        self.spare_m[what] = min(self.spare_m.get(what, np.inf), spare_m)

    def took(self, us: list[float]) -> None:
        """So long steps took."""
        for edge in np.minimum(np.searchsorted(TICK_US, us), len(TICK_US) - 1).tolist():
            self.tick_us[edge] += 1

    def add(self, other: CollisionReport) -> None:
        """Take in another part."""
        self.kinds.update(other.kinds)
        for name in ("ticks", "held_back", "beyond_limits", "stops", "stuck", "trapped"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.tick_us = [a + b for a, b in zip(self.tick_us, other.tick_us, strict=True)]
        for what, spare_m in other.spare_m.items():
            self.came(what, spare_m)

    def tick_at_most_us(self, share: float) -> int:
        """The edge below which this share of all steps was."""
        return TICK_US[int(np.searchsorted(np.cumsum(self.tick_us), share * sum(self.tick_us)))]

    @property
    def wrong(self) -> list[str]:
        """What should not have been."""
        wrong = [
            f"{what} came {-1000.0 * spare_m:.1f} mm nearer than its margin"
            for what, spare_m in self.spare_m.items()
            if spare_m < -SLACK_M
        ]
        wrong += [f"limits were exceeded in {self.beyond_limits} ticks"] * bool(self.beyond_limits)
        trapped = f"the robot could not be led back the way it had come {self.trapped} times"
        return wrong + [trapped] * bool(self.trapped)
