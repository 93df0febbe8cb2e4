"""Pictures of one camera as pixels. H.264 in order: a picture builds on the one before."""

from __future__ import annotations

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from common.errors import TandemError
from common.wire.video import H264, JPEG, FrameChain, VideoFrame

NO_PYAV = "this video is H.264, which needs PyAV: pip install 'tandem[h264]'"
Pixels = NDArray[np.uint8]
"""(height, width, 3) RGB."""


class PictureDecoder:
    """Decodes the pictures of one camera in the order in which they were sent."""

    def __init__(self) -> None:
        self.chain = FrameChain()
        self.undecodable = 0
        """Pictures that are damaged."""
        self._h264: _H264 | None = None

    def decode(self, frame: VideoFrame) -> Pixels | None:
        """(height, width, 3); None where it is damaged, or one that it builds on is missing.

        Raises TandemError for H.264 without PyAV.
        """
        if not self.chain.take(frame):
            return None
        try:
            return self._of_h264(frame) if frame.codec == H264 else decode_jpeg(frame.body)
        except ValueError:
            self.undecodable += 1
            self.chain.lose()
            return None

    def _of_h264(self, frame: VideoFrame) -> Pixels:
        if self._h264 is None or frame.after == 0:
            self._h264 = _H264()
        return self._h264.decode(frame.body)


def decode_jpeg(body: bytes) -> Pixels:
    """(height, width, 3). Raises ValueError where it is no JPEG."""
    pixels: Pixels = simplejpeg.decode_jpeg(body)
    return pixels


def as_jpeg(frame: VideoFrame, pixels: Pixels, quality: int = 85) -> bytes:
    """The picture as a JPEG: its own bytes where it is one."""
    if frame.codec == JPEG:
        return frame.body
    jpeg: bytes = simplejpeg.encode_jpeg(
        np.ascontiguousarray(pixels), quality=quality, colorsubsampling="420"
    )
    return jpeg


class _H264:
    """One stream, from a picture that stands alone."""

    def __init__(self) -> None:
        try:
            import av
        except ImportError:
            raise TandemError(NO_PYAV) from None
        self._av = av
        decoder = av.CodecContext.create("h264", "r")
        assert isinstance(decoder, av.VideoCodecContext)
        decoder.thread_count = 1  # else it holds pictures back
        self._decoder = decoder

    def decode(self, body: bytes) -> Pixels:
        """Raises ValueError where no picture comes out."""
        try:
            frames = self._decoder.decode(self._av.Packet(body))
        except self._av.FFmpegError as error:
            raise ValueError(str(error)) from None
        if not frames:
            raise ValueError("no picture came out")
        return frames[-1].to_ndarray(format="rgb24").astype(np.uint8, copy=False)
