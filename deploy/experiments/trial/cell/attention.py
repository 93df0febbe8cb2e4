"""The operator's eye on a robot that may hold in the judged time: what to remark, when to act. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Attention:
    """Told how the robot stands, again and again."""

    remarks: list[str] = field(default_factory=list)
    """In words, with the time in the judged seconds."""
    _holds: bool = False

    def look(self, at_s: float, guard: str, reason: str, ready: bool) -> bool:
        """Whether the operator engages now: it holds and takes his commands. A hold is remarked once."""
        if guard == "hold" and not self._holds:
            self.remarks.append(f"at {at_s:.1f} s the robot held: {reason}")
        self._holds = guard == "hold"
        return self._holds and ready

    def acted(self, at_s: float, refusal: str = "") -> None:
        """What came of engaging."""
        self.remarks.append(f"at {at_s:.1f} s {refusal or 'the operator engaged again'}")
