"""The buttons on the simulated suit: their frames, as `suit.dbc` describes them."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from common.can.frame import CanFrame
from common.config.section import Section
from master.deadman.can_button import CRC
from master.suit.crc import frame_crc
from master.suit.protocol import read_messages

PERIOD_S = 0.02
DEADMAN, CLUTCH = "DEADMAN", "CLUTCH"


class ButtonsConfig(Section):
    """`[buttons]`: a person who presses the deadman's button, and lets it go."""

    bus: str = Field(min_length=1)
    """On which of the suit's buses the frames go."""
    press_after_s: float = Field(0.5, ge=0.0)
    """From the start; before, it is seen released."""
    release_after_s: float | None = Field(None, gt=0.0)
    """From the start; None: it is held to the end."""

    def deadman_at(self, t_s: float) -> bool:
        """Whether the button is pressed that long after the start."""
        return self.press_after_s <= t_s < (self.release_after_s or float("inf"))


class Buttons:
    """The node that tells the buttons."""

    def __init__(self, dbc: Path) -> None:
        """Raises ConfigError where the DBC cannot be read."""
        self.pressed: set[str] = set()
        self._message = read_messages(dbc)["BUTTONS"]
        self._counter = 0

    def frame(self) -> CanFrame:
        """The next frame."""
        self._counter = (self._counter + 1) % 256
        bits = {name: int(name in self.pressed) for name in (DEADMAN, CLUTCH)}
        data = self._message.encode({**bits, "COUNTER": self._counter, CRC: 0})
        frame_id = self._message.frame_id
        return CanFrame(frame_id, data[:-1] + bytes([frame_crc(frame_id, data[:-1])]), fd=False)
