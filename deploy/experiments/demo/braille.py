"""Curves in a terminal: two by four dots to a character, drawn with the braille patterns of Unicode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.text import Text

from common.quaternion import Array

COLOURS = ("cyan", "magenta", "yellow", "green", "red", "blue")
_DOT = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a pattern by row and column of the dot."""
_BLANK = 0x2800
_LABEL = 6


def plot(curves: Sequence[Array], columns: int, rows: int, unit: str) -> Text:
    """Curves (K,) over one time axis, each in its colour of COLOURS, with the extremes written at the left.

    NaN leaves a gap. Where two curves share a character it has the colour of the later one.
    """
    low, high = _range(curves)
    bits = np.zeros((rows, columns), dtype=np.int64)
    owner = np.zeros((rows, columns), dtype=np.int64)
    for index, curve in enumerate(curves):
        for x, top, bottom in _strokes(curve, 2 * columns, 4 * rows, low, high):
            for y in range(top, bottom + 1):
                bits[y // 4, x // 2] |= _DOT[y % 4][x % 2]
                owner[y // 4, x // 2] = index
    digits = 0 if high - low >= 10.0 else 1
    labels = {0: f"{high:z.{digits}f}{unit}", rows - 1: f"{low:z.{digits}f}{unit}"}
    text = Text(no_wrap=True)
    for row in range(rows):
        text.append(f"{labels.get(row, ''):>{_LABEL}} ", "dim")
        for cell, index in zip(bits[row].tolist(), owner[row].tolist(), strict=True):
            text.append(chr(_BLANK + cell), COLOURS[index % len(COLOURS)])
        text.append("\n" if row < rows - 1 else "")
    return text


def _range(curves: Sequence[Array]) -> tuple[float, float]:
    """The curves' extremes; never of no width, as a line needs a place."""
    values = np.concatenate(list(curves))
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    return (low, high) if high - low >= 1.0 else (low - 0.5, low + 0.5)


def _strokes(curve: Array, width: int, height: int, low: float, high: float) -> list[tuple[int, int, int]]:
    """Column, upper and lower dot of the vertical stroke that the curve needs in each column it passes."""
    x = np.arange(len(curve)) * width // max(len(curve), 1)
    strokes: list[tuple[int, int, int]] = []
    last: int | None = None
    for column in range(width):
        values = curve[x == column]
        known = values[np.isfinite(values)]
        if len(known):
            y = np.rint((high - known) / (high - low) * (height - 1)).astype(np.int64).tolist()
            ends = y if last is None else [last, *y]
            strokes.append((column, min(ends), max(ends)))
            last = y[-1]
        elif len(values):
            # a gap: what comes after it begins anew
            last = None
    return strokes
