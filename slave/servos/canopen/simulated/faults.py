"""What can be made to go wrong with a simulated drive."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from common.errors import ConfigError, ConfigMistake
from common.skeleton import Skeleton

DEMAND = 0x2010
"""The manufacturer's object: a fault's number written to it happens at once."""


class Fault(IntEnum):
    """By the number in DEMAND."""

    NONE = 0
    OVER_CURRENT = 1
    OVER_TEMPERATURE = 2
    ENCODER_STUCK = 3
    MAGNET_LOST = 4
    PARITY = 5
    SILENT = 6
    RESTART = 7

    @property
    def option(self) -> str:
        """As a person writes it."""
        return self.name.lower().replace("_", "-")


CODES = {Fault.OVER_CURRENT: (0x2310, 0x03), Fault.OVER_TEMPERATURE: (0x4310, 0x09)}
"""Emergency code and error register of those that are the drive's own."""
OPTIONS = {fault.option: fault for fault in Fault}


@dataclass(frozen=True, slots=True)
class Planned:
    """A fault that will happen."""

    joint: str
    fault: Fault
    after_s: float
    """Seconds after the first SYNC."""


def planned(text: str, skeleton: Skeleton) -> Planned:
    """Read `JOINT=FAULT@SECONDS`, such as `left_elbow_pitch=over-current@5`. Raises ConfigError."""
    joint, _, rest = text.partition("=")
    name, _, seconds = rest.partition("@")
    try:
        after_s = float(seconds or "0")
    except ValueError:
        after_s = -1.0
    if joint not in skeleton.joint_names:
        expected = f"a joint of the {skeleton.name} profile before the ="
    elif name not in OPTIONS:
        expected = f"after the = one of {', '.join(OPTIONS)}"
    elif not 0.0 <= after_s <= 1e6:
        expected = "seconds after the @"
    else:
        return Planned(joint, OPTIONS[name], after_s)
    raise ConfigError("tandem drives", [ConfigMistake("--fault", text, expected)])
