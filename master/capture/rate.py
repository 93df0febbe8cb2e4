"""`[capture]`: how often the nodes are polled, and how often that yields a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from common.errors import ConfigMistake

AUTO: Literal["auto"] = "auto"
USUAL_HZ = 12.5
"""Commands a second where nothing else is said: what every line must carry."""
MOST_HZ = 50.0
"""Of commands: nobody's arm moves so that more would show, and each costs the robot 0.1 ms."""


@dataclass(frozen=True, slots=True)
class CaptureRate:
    """Ticks a second, and which of them decide."""

    rate_hz: int
    command_hz: float | Literal["auto"]
    fixed: int | None
    """One tick in so many, as the file says; None: as `command_hz` says."""

    @property
    def usual(self) -> int:
        """One tick in so many decides at the start."""
        if self.fixed is not None:
            return self.fixed
        return self._ticks(USUAL_HZ if self.command_hz == AUTO else self.command_hz)

    def decimation(self, period_ms: int) -> int:
        """One tick in so many for a wanted period; 0: the usual one."""
        wanted = round(1e-3 * period_ms * self.rate_hz) or self.usual
        return min(max(wanted, self._ticks(MOST_HZ)), self.usual)

    def hz(self, decimation: int) -> float:
        """Commands a second."""
        return self.rate_hz / decimation

    def mistakes(self) -> list[ConfigMistake]:
        """A rate that does not divide the ticks', and two keys that contradict each other."""
        hz = self.command_hz
        if hz == AUTO:
            if self.fixed is not None:
                what = 'nothing beside command_hz = "auto": one tick in how many decides is negotiated'
                return [ConfigMistake("capture.decimation", self.fixed, what)]
            return []
        if self.fixed is None and not (self.rate_hz / hz).is_integer() and hz != USUAL_HZ:
            what = f"a rate that divides rate_hz, {self.rate_hz}, such as 12.5, 25 or 50"
            return [ConfigMistake("capture.command_hz", hz, what)]
        return []

    def _ticks(self, hz: float) -> int:
        return max(1, round(self.rate_hz / hz))
