"""Draws a code. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.picture_code.cells import FRAME, MARGIN, cells_of, count_of

Luma = NDArray[np.uint8]
"""(height, width), 0 is black."""


def draw_code(time_ns: int, cell_px: int) -> Luma:
    """The code of a time with its frame and margin: 10 × 12 cells, each `cell_px` wide and high."""
    plan = np.pad(cells_of(count_of(time_ns)), FRAME, constant_values=False)
    plan = np.pad(plan, MARGIN, constant_values=True)
    luma: Luma = np.kron(plan, np.ones((cell_px, cell_px), np.bool_)).astype(np.uint8) * 255
    return luma


def paste_code(pixels: NDArray[np.uint8], time_ns: int, at_px: tuple[int, int], cell_px: int) -> None:
    """Draw the code of a time into `pixels` (height, width[, 3]), its upper left corner at (row, column).

    Raises ValueError where it does not fit.
    """
    code = draw_code(time_ns, cell_px)
    row, column = at_px
    place = pixels[row : row + code.shape[0], column : column + code.shape[1]]
    if row < 0 or column < 0 or place.shape[:2] != code.shape:
        size = f"{code.shape[1]}×{code.shape[0]}"
        raise ValueError(f"a code of {size} px does not fit at row {row}, column {column} of the picture")
    place[:] = code if pixels.ndim == 2 else code[..., None]
