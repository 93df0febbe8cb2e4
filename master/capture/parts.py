"""What a sample of another maker's node holds, and which message carries what of it. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from common.can.frame import EXTENDED

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

ACC, GYR, MAG, TURN = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 13)
STAMP, COUNTER = 13, 14
CHANNELS = 15
"""What a sample holds: accelerometer, gyro, magnetometer, quaternion (or three angles), own time, count."""
PLACES = {"accelerometer": 0, "gyroscope": 3, "magnetometer": 6}


@dataclass(frozen=True, slots=True)
class Mapped:
    """One signal, and the channel that it is."""

    signal: Signal
    channel: int
    factor: float
    """To SI (µT, s), after the DBC's own scale."""
    needed: bool = True
    """Whether every sample has it."""


@dataclass(slots=True)
class Part:
    """One message of a sample, under one value of its multiplexer if it has one."""

    message: Message
    mapped: list[Mapped] = field(default_factory=list)
    selects: dict[str, int] = field(default_factory=dict)
    """Multiplexers and the value that each must have."""

    @property
    def frame_id(self) -> int:
        """As in the DBC; marked where it has 29 bits."""
        return self.message.frame_id | (EXTENDED if self.message.is_extended_frame else 0)

    @property
    def needed(self) -> bool:
        """Whether a sample waits for it: a slower sensor's own message is not waited for."""
        return any(each.needed for each in self.mapped)


@dataclass(frozen=True, slots=True)
class NodeLayout:
    """What one node sends."""

    parts: tuple[Part, ...]
    first: int
    """The part with which a sample begins."""
    step: int
    """What is added to the identifiers."""
