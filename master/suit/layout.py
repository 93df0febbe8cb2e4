"""From the DBC to numpy: where the fields of a node's answer lie, and how many are read at once.

All fields are little-endian. The readings (16-bit) stand side by side on byte boundaries; tick and status
may be bit fields that share a byte; the CRC is the last byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from master.suit.crc import BatchCrc, Bytes, frame_crc

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

Raw = NDArray[np.int16]


class LayoutError(ValueError):
    """A message of the DBC that is not laid out as tandem reads it; the text names message and signal."""


@dataclass(frozen=True, slots=True)
class BitField:
    """An unsigned field of at most 32 bits, inside one little-endian word of the frame."""

    start: int
    """First bit, counted from the lowest of byte 0."""
    mask: int
    """Its value when all bits are set."""
    byte: int
    """Where its word starts."""
    dtype: np.dtype[np.unsignedinteger]
    shift: int
    """Its lowest bit within the word."""


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """A batch of F answers of one layout."""

    raw: Raw
    """(F, k) counts as the sensors gave them."""
    tick: NDArray[np.integer]
    """(F,) tick, as far as the layout carries it."""
    status: NDArray[np.integer]
    """(F,)"""
    folded: Bytes
    """(F,) `BatchCrc.folded`."""


class AnswerLayout:
    """One answer message of the DBC."""

    def __init__(self, message: Message, readings: tuple[str, ...]) -> None:
        """`readings` names the signals that must stand side by side. Raises LayoutError."""
        self.name = message.name
        self.base_id = message.frame_id
        self.length = message.length
        signals = {signal.name: signal for signal in message.signals}
        wanted = {*readings, "TICK", "STATUS", "CRC"}
        if set(signals) != wanted:
            wrong = ", ".join(sorted(set(signals) ^ wanted))
            raise LayoutError(f"{self.name}: expected only its readings, TICK, STATUS and CRC; see {wrong}")
        if message.is_extended_frame:
            raise LayoutError(f"{self.name}: expected an 11-bit identifier")
        for signal in message.signals:
            if signal.byte_order != "little_endian" or signal.conversion.offset != 0:
                raise LayoutError(f"{self.name}.{signal.name}: expected little-endian and no offset")
        self.scale = np.array([float(signals[name].conversion.scale) for name in readings])
        """SI per count of each reading, (k,)."""
        self._readings_byte = self._first_byte([signals[name] for name in readings])
        self.tick = self._bit_field(signals["TICK"])
        self.status = self._bit_field(signals["STATUS"])
        crc = signals["CRC"]
        if (crc.start, crc.length) != (8 * (self.length - 1), 8):
            raise LayoutError(f"{self.name}.CRC: expected the last byte")
        self.crc = BatchCrc(self.length)
        after_readings = self._readings_byte + 2 * len(readings)
        if min(self.tick.byte, self.status.byte) < after_readings:
            raise LayoutError(f"{self.name}: expected TICK and STATUS after the readings")
        self._tail = (after_readings, self.length - 1)
        self.dtype = np.dtype(
            {
                "names": ["raw", "tick", "status"],
                "formats": [("<i2", len(readings)), self.tick.dtype, self.status.dtype],
                "offsets": [self._readings_byte, self.tick.byte, self.status.byte],
                "itemsize": self.length,
            }
        )
        """A frame as one structured value: `raw` (k,), and the words that hold `tick` and `status`."""

    def _first_byte(self, readings: list[Signal]) -> int:
        first = readings[0].start
        for place, signal in enumerate(readings):
            if not signal.is_signed or signal.length != 16 or signal.start != first + 16 * place:
                raise LayoutError(f"{self.name}.{signal.name}: expected 16 signed bits beside the one before")
        if first % 8:
            raise LayoutError(f"{self.name}.{readings[0].name}: expected to start on a byte")
        return first // 8

    def _bit_field(self, signal: Signal) -> BitField:
        byte, shift = divmod(signal.start, 8)
        width = next((w for w in (1, 2, 4) if shift + signal.length <= 8 * w), None)
        if signal.is_signed or width is None or byte + width > self.length:
            raise LayoutError(f"{self.name}.{signal.name}: expected unsigned, within 1, 2 or 4 bytes")
        return BitField(signal.start, (1 << signal.length) - 1, byte, np.dtype(f"<u{width}"), shift)

    def same_shape(self, other: AnswerLayout) -> bool:
        """True where frames of both can be decoded in one batch."""
        return self.dtype == other.dtype and (self.tick, self.status) == (other.tick, other.status)

    def decode(self, frames: bytes) -> DecodedFrame:
        """Read F frames that lie one after the other, F × length bytes. Checks nothing."""
        table = np.frombuffer(frames, dtype=self.dtype)
        as_bytes = np.frombuffer(frames, dtype=np.uint8).reshape(-1, self.length)
        tick, status = self.tick, self.status
        return DecodedFrame(
            raw=table["raw"],
            tick=(table["tick"] >> tick.shift) & tick.mask,
            status=(table["status"] >> status.shift) & status.mask,
            folded=self.crc.folded(as_bytes),
        )

    def raw(self, frames: bytes) -> Raw:
        """Readings (F, k) of F frames that lie one after the other."""
        readings: Raw = np.frombuffer(frames, dtype=self.dtype)["raw"]
        return readings

    def is_all(self, frames: bytes, tick: int, status: int, folded: Bytes) -> bool:
        """Whether all F frames have that tick and status and a sound CRC (`folded` (F,) as it should be)."""
        table = np.frombuffer(frames, dtype=np.uint8).reshape(-1, self.length)
        begin, end = self._tail
        tail = self._bits_of(tick, status).to_bytes(self.length, "little")[begin:end]
        if table[:, begin:end].tobytes() != tail * len(table):
            return False
        return self.crc.folded(table).tobytes() == folded.tobytes()

    def _bits_of(self, tick: int, status: int) -> int:
        bits = (tick & self.tick.mask) << self.tick.start
        return bits | (status & self.status.mask) << self.status.start

    def encode(self, frame_id: int, raw: Raw, tick: int, status: int) -> bytes:
        """The data of one answer: raw (k,) counts, tick and status cut to their fields, CRC."""
        readings = int.from_bytes(raw.astype("<i2").tobytes(), "little")
        bits = readings << (8 * self._readings_byte) | self._bits_of(tick, status)
        covered = bits.to_bytes(self.length - 1, "little")
        return covered + bytes((frame_crc(frame_id, covered),))

    def si(self, raw: Raw) -> Array:
        """Counts (..., k) in SI units (µT for the field)."""
        out: Array = raw * self.scale
        return out
