"""The best H.264 picture within a number of bytes, by PyAV (extra `h264`). For the camera's process.

x264 is held to one picture's bytes by a buffer (VBV) that holds one picture, also for a picture that stands
alone. It takes that size when it is opened, so another number of bytes opens it anew: at once where it must
send less, and at most once a second where it may send more. No B-frames and no look-ahead: a picture in is a
picture out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np

from common.errors import RobotError
from slave.camera.jpeg import Pixels, shrink

NO_PYAV = "H.264 needs PyAV with libx264: pip install 'tandem[h264]', or set camera.codec to jpeg"
SHARES = (1, 2, 4)
"""Of width and height."""
LEAST_BITS_PER_PIXEL = 0.06
"""Below it a picture of half the width and height shows more."""
_ROOM = 1.6
"""The larger size is tried again where it would have this much more than that."""
_LESS, _MORE = 0.85, 1.3
"""Shares of the opened number of bytes within which it is left as it is."""


@dataclass(frozen=True, slots=True)
class EncodedPicture:
    """One picture of a stream."""

    body: bytes
    width: int
    height: int
    alone: bool
    """Whether it can be decoded without those before it."""


class Stream(Protocol):
    """An opened encoder."""

    def encode(self, pixels: Pixels, alone: bool) -> tuple[bytes, bool]:
        """A picture's bytes, and whether it stands alone."""
        ...


OpenStream = Callable[[int, int, float, int], Stream]
"""Opens one for width, height, pictures a second, bytes of one picture."""


class H264Fitter:
    """Keeps one encoder, and opens another one where size or bytes have changed enough."""

    def __init__(self, rate_hz: float, open_stream: OpenStream | None = None) -> None:
        """Raises RobotError without PyAV."""
        self._rate_hz = rate_hz
        self._open = open_stream or open_x264
        self._stream: Stream | None = None
        self._size: tuple[int, int] = 0, 0
        self._bytes = 0
        self._since_opened = 0
        self.share = 1

    def fit(self, pixels: Pixels, most_bytes: int, alone: bool) -> EncodedPicture:
        """The picture, at a share of its size that the bytes suffice for."""
        height, width = pixels.shape[:2]
        self.share = _share_for(width * height, most_bytes, self.share)
        smaller = _even(shrink(pixels, self.share))
        size = smaller.shape[1], smaller.shape[0]
        if self._stream is None or size != self._size or self._other_bytes(most_bytes):
            self._stream = self._open(*size, self._rate_hz, most_bytes)
            self._size, self._bytes, self._since_opened = size, most_bytes, 0
        self._since_opened += 1
        body, stands_alone = self._stream.encode(smaller, alone)
        return EncodedPicture(body, *size, stands_alone)

    def _other_bytes(self, most_bytes: int) -> bool:
        if most_bytes < _LESS * self._bytes:
            return True
        return most_bytes > _MORE * self._bytes and self._since_opened >= self._rate_hz


def _share_for(pixels: int, most_bytes: int, before: int) -> int:
    """The largest size with enough bits a pixel; a larger one than before only with room."""
    for share in SHARES:
        needed = LEAST_BITS_PER_PIXEL * (_ROOM if share < before else 1.0)
        if 8 * most_bytes >= needed * pixels / share**2:
            return share
    return SHARES[-1]


def _even(pixels: Pixels) -> Pixels:
    """H.264 of half the colour's width and height wants even numbers."""
    height, width = pixels.shape[:2]
    return np.ascontiguousarray(pixels[: height // 2 * 2, : width // 2 * 2])


def open_x264(width: int, height: int, rate_hz: float, most_bytes: int) -> Stream:
    """x264 by PyAV. Raises RobotError where there is none."""
    try:
        import av

        encoder = av.CodecContext.create("libx264", "w")
    except Exception as error:  # ImportError, and PyAV's own where its build has no x264
        raise RobotError(f"{NO_PYAV} ({type(error).__name__}: {error})") from error
    bits_per_s = round(8 * most_bytes * rate_hz)
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuv420p"
    rate = Fraction(rate_hz).limit_denominator(1000)
    encoder.framerate, encoder.time_base = rate, 1 / rate
    encoder.bit_rate, encoder.gop_size, encoder.thread_count = bits_per_s, 100_000, 1
    encoder.options = {
        "preset": "ultrafast", "tune": "zerolatency", "profile": "baseline", "forced-idr": "1",
        "maxrate": str(bits_per_s), "bufsize": str(8 * most_bytes), "x264-params": "scenecut=0",
    }  # fmt: skip
    return _X264(encoder)


class _X264:
    def __init__(self, encoder: object) -> None:
        import av

        assert isinstance(encoder, av.VideoCodecContext)
        self._av = av
        self._encoder = encoder
        self._count = 0

    def encode(self, pixels: Pixels, alone: bool) -> tuple[bytes, bool]:
        frame = self._av.VideoFrame.from_ndarray(pixels, format="rgb24")
        frame.pts = self._count
        if alone or self._count == 0:
            frame.pict_type = self._av.video.frame.PictureType.I
        self._count += 1
        try:
            packets = self._encoder.encode(frame)
        except self._av.FFmpegError as error:
            raise RobotError(f"H.264: {error}") from None
        if len(packets) != 1:
            raise RobotError(f"H.264: {len(packets)} pictures came out for one that went in")
        return bytes(packets[0]), bool(packets[0].is_keyframe)
