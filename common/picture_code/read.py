"""Finds codes in a picture and reads them: after JPEG, H.264, shrinking, tilt and poor light. Pure.

Each dark, connected region of the right shape is tried as a code's frame: its four corners give the
projection of the plane (a homography), which gives the middle of each cell. What is none, the CRC refuses.
Several thresholds of darkness are tried, so that no light has to be known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.picture_code.cells import COLUMNS, FRAME, ROWS, count_in, resolve_ns
from common.quaternion import Array

THRESHOLDS = (40, 70, 100, 130, 160)
"""A pixel below one of them counts as dark."""
LEAST_CONTRAST = 30.0
"""Between the white margin and the black frame."""
_WIDE, _HIGH = COLUMNS + 2 * FRAME, ROWS + 2 * FRAME
_LEAST_PX = 2.0
"""Of one cell; below it the cells run into one another."""
_ASPECT = 0.5, 2.6
"""Width by height of a region that may be a frame, seen at an angle; straight on it is 1.25."""


@dataclass(frozen=True, slots=True)
class FoundCode:
    """A code that was read."""

    count: int
    """Of 0.1 ms; `resolve_ns` makes a time of it."""
    corners_px: tuple[tuple[float, float], ...]
    """(column, row) of the frame's outer corners: upper left, upper right, lower right, lower left."""


def read_codes(pixels: NDArray[np.uint8]) -> list[FoundCode]:
    """All codes in a picture (height, width) of luma, or (height, width, 3) of RGB; each count once."""
    luma = pixels if pixels.ndim == 2 else _luma(pixels)
    found: dict[int, FoundCode] = {}
    tried: set[tuple[tuple[float, float], ...]] = set()
    for threshold in THRESHOLDS:
        for corners in _frames(luma < threshold):
            key = tuple((float(x), float(y)) for x, y in corners)
            if key in tried:
                continue
            tried.add(key)
            count = _read(luma, corners)
            if count is not None:
                found.setdefault(count, FoundCode(count, key))
    return list(found.values())


def newest_ns(codes: list[FoundCode], near_ns: int) -> int | None:
    """The newest time that the codes say, on the clock of `near_ns`; None where there is none.

    A screen shows two codes and renews them in turn: at least one of the two is whole in any picture.
    """
    return max((resolve_ns(code.count, near_ns) for code in codes), default=None)


def _luma(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    weights = np.array([77, 150, 29], np.uint16)
    luma: NDArray[np.uint8] = ((rgb.astype(np.uint16) * weights).sum(axis=2) >> 8).astype(np.uint8)
    return luma


def _frames(dark: NDArray[np.bool_]) -> Iterator[Array]:
    """(4, 2) corners of each region that may be a frame."""
    from scipy import ndimage  # 20 MB, which a console that only receives has no use for

    labels, _ = ndimage.label(dark)
    for number, box in enumerate(ndimage.find_objects(labels), start=1):
        high, wide = (side.stop - side.start for side in box)
        if wide < _LEAST_PX * _WIDE * 0.8 or high < _LEAST_PX * _HIGH * 0.8:
            continue
        if not _ASPECT[0] < wide / high < _ASPECT[1]:
            continue
        rows, columns = np.nonzero(labels[box] == number)
        yield _corners(columns + box[1].start, rows + box[0].start)


def _corners(x: NDArray[np.int64], y: NDArray[np.int64]) -> Array:
    """Outer corners of a region that is upright within 45°. Pixels reach half a pixel beyond their middle."""
    picks = [int(np.argmin(x + y)), int(np.argmax(x - y)), int(np.argmax(x + y)), int(np.argmin(x - y))]
    outward = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    out: Array = np.array([(x[i], y[i]) for i in picks], dtype=np.float64) + outward
    return out


def _read(luma: NDArray[np.uint8], corners: Array) -> int | None:
    plane = _projection(corners)
    if plane is None:
        return None
    columns, rows = np.meshgrid(np.arange(-1, _WIDE + 1) + 0.5, np.arange(-1, _HIGH + 1) + 0.5)
    seen = _sample(luma, plane, columns, rows)
    if seen is None:
        return None
    margin = np.concatenate((seen[0], seen[-1], seen[1:-1, 0], seen[1:-1, -1]))
    inside = seen[1:-1, 1:-1]
    frame = np.concatenate((inside[0], inside[-1], inside[1:-1, 0], inside[1:-1, -1]))
    white, black = float(np.median(margin)), float(np.median(frame))
    if white - black < LEAST_CONTRAST:
        return None
    return count_in(inside[FRAME:-FRAME, FRAME:-FRAME] > 0.5 * (white + black))


def _projection(corners: Array) -> Array | None:
    """(3, 3) from cells, counted from the frame's upper left corner, to pixels; None for a flat region."""
    cells = np.array([(0, 0), (_WIDE, 0), (_WIDE, _HIGH), (0, _HIGH)], dtype=np.float64)
    equations, values = np.zeros((8, 8)), np.zeros(8)
    for i, ((u, v), (x, y)) in enumerate(zip(cells, corners, strict=True)):
        equations[2 * i] = (u, v, 1, 0, 0, 0, -u * x, -v * x)
        equations[2 * i + 1] = (0, 0, 0, u, v, 1, -u * y, -v * y)
        values[2 * i], values[2 * i + 1] = x, y
    try:
        solved = np.linalg.solve(equations, values)
    except np.linalg.LinAlgError:
        return None
    return np.append(solved, 1.0).reshape(3, 3)


def _sample(luma: NDArray[np.uint8], plane: Array, columns: Array, rows: Array) -> Array | None:
    """Luma between the four pixels around each point; the margin may lie outside of the picture."""
    from scipy import ndimage  # 20 MB, which a console that only receives has no use for

    x, y, scale = np.tensordot(plane, np.stack((columns, rows, np.ones_like(rows))), axes=1)
    if (scale <= 1e-6).any():
        return None
    out: Array = ndimage.map_coordinates(
        luma.astype(np.float64), (y / scale, x / scale), order=1, mode="nearest"
    )
    return out
