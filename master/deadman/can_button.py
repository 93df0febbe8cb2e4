"""A button that a node of the suit tells in a frame of its own, sent again and again. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from common.clock import to_ns
from common.errors import ConfigError, ConfigMistake
from master.deadman.config import CanButton
from master.suit.crc import frame_crc
from master.suit.protocol import LARGEST_ID, read_messages

if TYPE_CHECKING:
    from cantools.database.can import Message

COUNTER, CRC = "COUNTER", "CRC"
"""Signals that a message may have: one that changes with every frame, and `suit.dbc`'s check at the end."""


class CanButtonState:
    """Whether the button is down. A frame that is late, repeated or wrong does not keep it down."""

    def __init__(self, config: CanButton, message: Message) -> None:
        self.bus, self.frame_id = config.bus, message.frame_id
        self.releases = 0
        """How often it went up: a release between two looks is seen, though it is down again."""
        self.refused = 0
        """Frames of a wrong length or CRC, and those whose counter stood."""
        self._config = config
        self._message = message
        self._signals = {signal.name for signal in message.signals}
        self._down: bool | None = None
        self._heard_ns = 0
        self._counter: object = None
        self._words = "its frame has not been heard yet"

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take a frame; False where it is another one."""
        if bus != self._config.bus or frame_id != self.frame_id:
            return False
        self.at(now_ns)  # a gap before this frame counts
        values = self._values(data)
        if values is None:
            self.refused += 1
            return True
        self._set(bool(values[self._config.signal]), now_ns)
        return True

    def bus_down(self, bus: str) -> None:
        """The bus has failed."""
        if bus == self._config.bus:
            self._lose(f"the bus {bus} has failed")

    def at(self, now_ns: int) -> bool | None:
        """Whether it is down now; None while nobody can know."""
        if self._down is not None and abs(now_ns - self._heard_ns) > to_ns(self._config.timeout_s):
            self._lose(
                f"no good frame {self._message.name} for {self._config.timeout_s:g} s on {self._config.bus}"
            )
        return self._down

    @property
    def words(self) -> str:
        """Why it is not known; empty where it is."""
        return self._words if self._down is None else ""

    def _values(self, data: bytes) -> Mapping[str, object] | None:
        """The signals of a good frame."""
        if len(data) != self._message.length:
            return None
        if CRC in self._signals and frame_crc(self.frame_id, data[:-1]) != data[-1]:
            return None
        values: Mapping[str, object] = self._message.decode_simple(data, decode_choices=False, scaling=False)
        if COUNTER in self._signals:
            before, self._counter = self._counter, values[COUNTER]
            if before == self._counter:
                return None
        return values

    def _set(self, down: bool, now_ns: int) -> None:
        self.releases += bool(self._down) and not down
        self._down, self._heard_ns = down, now_ns

    def _lose(self, words: str) -> None:
        self.releases += bool(self._down)
        self._down, self._words = None, words


def load_button(
    config: CanButton, dbc: Path, taken: Mapping[tuple[str, int], str], key: str
) -> CanButtonState:
    """The button that the DBC describes. Raises ConfigError.

    `taken`: what the identifiers of other frames are, by bus and identifier. `key`: the section's.
    """
    messages = read_messages(dbc)
    message = messages.get(config.message)
    if message is None:
        raise _mistake(key, "message", config.message, f"a message of {dbc.name}: {_list(list(messages))}")
    signals = [signal.name for signal in message.signals]
    if config.signal not in signals:
        raise _mistake(key, "signal", config.signal, f"a signal of {config.message}: {_list(signals)}")
    if message.is_extended_frame or message.frame_id > LARGEST_ID:
        raise _mistake(key, "message", config.message, "a message with an 11-bit identifier")
    other = taken.get((config.bus, message.frame_id))
    if other is not None:
        expected = f"an identifier of its own: {message.frame_id:#x} is {other}"
        raise _mistake(key, "message", config.message, expected)
    if CRC in signals and message.get_signal_by_name(CRC).start != 8 * (message.length - 1):
        raise _mistake(key, "message", config.message, "its CRC in the last byte")
    return CanButtonState(config, message)


def _list(names: Sequence[str]) -> str:
    return ", ".join(names)


def _mistake(section: str, key: str, value: str, expected: str) -> ConfigError:
    return ConfigError("the master's file", [ConfigMistake(f"{section}.{key}", value, expected)])
