"""The best JPEG of a picture within a number of bytes."""

from __future__ import annotations

import numpy as np
import simplejpeg
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
"""(height, width, 3) RGB."""

LEVELS = ((1, 85), (1, 70), (1, 50), (1, 35), (2, 60), (2, 40), (2, 25), (4, 40), (4, 20))
"""Share of width and height, and quality; best first, each about a third smaller than the one before."""
_ROOM = 1.6
"""A better level is tried where the last picture left this much room."""


class Fitter:
    """Picks the level: the one that was right for the last picture, or its neighbours."""

    def __init__(self) -> None:
        self.level = 3

    def fit(self, pixels: Pixels, most_bytes: int) -> tuple[bytes, int, int]:
        """JPEG, width, height. Where even the worst level is too large, it is the worst level's."""
        jpeg, size = _encode(pixels, self.level)
        while len(jpeg) > most_bytes and self.level + 1 < len(LEVELS):
            self.level += 1
            jpeg, size = _encode(pixels, self.level)
        if len(jpeg) * _ROOM < most_bytes and self.level > 0:
            better, better_size = _encode(pixels, self.level - 1)
            if len(better) <= most_bytes:
                self.level -= 1
                jpeg, size = better, better_size
        return jpeg, *size


def decode(jpeg: bytes) -> Pixels:
    """The pixels. Raises ValueError where it is no JPEG."""
    pixels: Pixels = simplejpeg.decode_jpeg(jpeg, colorspace="RGB")
    return pixels


def size_of(jpeg: bytes) -> tuple[int, int]:
    """Width and height. Raises ValueError where it is no JPEG."""
    height, width, *_ = simplejpeg.decode_jpeg_header(jpeg)
    return width, height


def _encode(pixels: Pixels, level: int) -> tuple[bytes, tuple[int, int]]:
    share, quality = LEVELS[level]
    smaller = shrink(pixels, share)
    jpeg: bytes = simplejpeg.encode_jpeg(
        smaller, quality=quality, colorspace="RGB", colorsubsampling="420", fastdct=True
    )
    return jpeg, (smaller.shape[1], smaller.shape[0])


def shrink(pixels: Pixels, share: int) -> Pixels:
    """Each square of `share` × `share` pixels as its mean; what is left over at the edges is cut off."""
    if share == 1:
        return np.ascontiguousarray(pixels)
    height, width = (n // share for n in pixels.shape[:2])
    squares = pixels[: height * share, : width * share].reshape(height, share, width, share, 3)
    out: Pixels = squares.mean(axis=(1, 3), dtype=np.float32).astype(np.uint8)
    return out
