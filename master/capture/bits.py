"""Signals of a DBC message out of many frames at once. Pure.

A frame's bits are a vector, and an integer signal is a weighted sum of some of them: its lowest bit counts
1, the next 2, and the highest bit of a signed one -2^(n-1). So one product with a matrix reads all signals
of all frames, whatever their length, byte order and sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array

if TYPE_CHECKING:
    from cantools.database.can import Signal

LARGEST_INTEGER_BITS = 52
"""A double holds each integer of so many bits."""


def columns_of(signal: Signal) -> list[int]:
    """Where a signal's bits stand, its lowest first: bits counted from the highest of byte 0."""
    if signal.byte_order == "little_endian":
        return [8 * (bit // 8) + 7 - bit % 8 for bit in range(signal.start, signal.start + signal.length)]
    highest = 8 * (signal.start // 8) + 7 - signal.start % 8
    return list(range(highest + signal.length - 1, highest - 1, -1))


def wrong_with(signal: Signal) -> str | None:
    """Why a signal cannot be read, as what was expected; None where it can."""
    if signal.is_float:
        return None if signal.length == 32 else "a float of 32 bits"
    return None if signal.length <= LARGEST_INTEGER_BITS else f"at most {LARGEST_INTEGER_BITS} bits"


class IntegerField:
    """One unsigned integer signal, read frame by frame: what tells which node or part a frame is."""

    def __init__(self, signal: Signal) -> None:
        self._order: Literal["little", "big"] = "little" if signal.byte_order == "little_endian" else "big"
        self._lowest = signal.start if self._order == "little" else columns_of(signal)[0]
        self._mask = (1 << signal.length) - 1

    def read(self, data: bytes) -> int:
        """Its raw value; bits beyond the frame are zero."""
        bits = int.from_bytes(data, self._order)
        if self._order == "little":
            return bits >> self._lowest & self._mask
        above = 8 * len(data) - 1 - self._lowest
        return (bits >> above if above >= 0 else bits << -above) & self._mask


class SignalReader:
    """Reads S signals of one message."""

    def __init__(self, signals: Sequence[Signal], length: int) -> None:
        """`length` in bytes: longer frames are cut, shorter ones must not be given."""
        self.length = length
        self._weights = np.zeros((8 * length, len(signals)))
        for place, signal in enumerate(signals):
            weights = 2.0 ** np.arange(signal.length)
            if signal.is_signed and not signal.is_float:
                weights[-1] = -weights[-1]
            self._weights[columns_of(signal), place] = weights
        self._floats = [place for place, signal in enumerate(signals) if signal.is_float]
        self._scale = np.array([float(signal.conversion.scale) for signal in signals])
        self._offset = np.array([float(signal.conversion.offset) for signal in signals])
        self._as_they_are = bool((self._scale == 1.0).all() and (self._offset == 0.0).all())

    def read(self, frames: Sequence[bytes]) -> Array:
        """Values (F, S) in the DBC's units."""
        length = self.length
        joined = b"".join(frames)
        if len(joined) != length * len(frames):
            joined = b"".join([frame[:length] for frame in frames])
        table = np.frombuffer(joined, np.uint8).reshape(len(frames), length)
        values: Array = np.unpackbits(table, axis=1).astype(np.float64) @ self._weights
        for place in self._floats:
            values[:, place] = _as_float(values[:, place])
        if not self._as_they_are:
            values *= self._scale
            values += self._offset
        return values


def _as_float(bits: Array) -> NDArray[np.float32]:
    out: NDArray[np.float32] = bits.astype(np.uint32).view(np.float32)
    return out
