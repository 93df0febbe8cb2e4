"""The options of a soak."""

from __future__ import annotations

import re
from dataclasses import dataclass

from common.errors import ConfigError, ConfigMistake

_PART = re.compile(r"(\d+(?:\.\d+)?)\s*(h|min|m|s)")
_SECONDS = {"h": 3600.0, "min": 60.0, "m": 60.0, "s": 1.0}
SHORTEST_S = 10.0


@dataclass(frozen=True, slots=True)
class SoakOptions:
    """One soak. `duration_s` counts from when the robot first follows."""

    duration_s: float
    transport: str = "tcp"
    profile: str | None = None
    """The network between two namespaces; None: local endpoints."""
    router: bool = False
    """Whether master and robot meet at a router."""
    faults: tuple[str, ...] = ()
    every_s: float | None = None
    """Mean time between faults; None: by duration and kinds."""
    seed: int = 1
    robot_profile: str = "nursing"


def seconds(text: str) -> float:
    """`8h`, `1h30m`, `90s` or plain seconds. Raises ConfigError."""
    parts = _PART.findall(text)
    try:
        value = sum(float(number) * _SECONDS[unit] for number, unit in parts) if parts else float(text)
    except ValueError:
        value = -1.0
    if _PART.sub("", text).strip() and parts:
        value = -1.0
    if not SHORTEST_S <= value < 366 * 86_400.0:
        expected = f"a time such as 8h, 30m or 90s, at least {SHORTEST_S:g} s"
        raise ConfigError("soak", [ConfigMistake("--duration", text, expected)])
    return value


def in_words(duration_s: float) -> str:
    """Such as `1 h 05 min 09 s`."""
    whole = max(0, round(duration_s))
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    if hours:
        return f"{hours} h {minutes:02d} min {rest:02d} s"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
