"""Signals of a DBC message out of many frames at once. Pure.

A frame's bits are a vector, and an integer signal is a weighted sum of some of them: its lowest bit counts
1, the next 2, and the highest bit of a signed one -2^(n-1). So one product with a matrix reads all signals
of all frames, whatever their length, byte order and sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Placed:
    """A signal in a row of bytes that may hold several messages."""

    signal: Signal
    bit: int = 0
    """Where its message begins in the row."""
    factor: float = 1.0
    """After the DBC's own scale."""


class SignalReader:
    """Reads S signals out of rows of bytes, each row one message or several one after the other."""

    def __init__(
        self,
        signals: Sequence[Placed],
        length: int,
        columns: Sequence[int] | None = None,
        width: int | None = None,
    ) -> None:
        """`length`: bytes of a row. `columns` (S,) of the `width` that are read; all by turns without."""
        self.length = length
        columns = range(len(signals)) if columns is None else columns
        width = len(signals) if width is None else width
        self._weights = np.zeros((8 * length, width))
        self._scale, self._offset = np.zeros(width), np.full(width, np.nan)
        self._floats = [column for column, each in zip(columns, signals, strict=True) if each.signal.is_float]
        for column, each in zip(columns, signals, strict=True):
            signal, conversion = each.signal, each.signal.conversion
            powers = 2.0 ** np.arange(signal.length)
            if signal.is_signed and not signal.is_float:
                powers[-1] = -powers[-1]
            self._weights[np.array(columns_of(signal)) + each.bit, column] = powers
            self._scale[column] = float(conversion.scale) * each.factor
            self._offset[column] = float(conversion.offset) * each.factor

    def read(self, rows: bytes) -> Array:
        """Values (F, width) of F rows, in the DBC's units times the signals' factors.

        NaN in columns of which no signal is.
        """
        bits = np.unpackbits(np.frombuffer(rows, np.uint8).reshape(-1, self.length), axis=1)
        values: Array = bits.astype(np.float64) @ self._weights
        if self._floats:
            # what a unit sends as NaN or infinity stays so
            with np.errstate(invalid="ignore", over="ignore"):
                for column in self._floats:
                    values[:, column] = _as_float(values[:, column])
                values *= self._scale
        else:
            values *= self._scale
        values += self._offset
        return values


def _as_float(bits: Array) -> NDArray[np.float32]:
    out: NDArray[np.float32] = bits.astype(np.uint32).view(np.float32)
    return out
