"""The node of the simulated glove that tells its buttons, as `suit.dbc` describes their frames."""

from __future__ import annotations

from pathlib import Path

from common.can.frame import CanFrame
from master.deadman.can_button import CRC
from master.suit.crc import frame_crc
from master.suit.protocol import read_messages

PERIOD_S = 0.02
"""Between two frames."""
DEADMAN, CLUTCH = "DEADMAN", "CLUTCH"


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
