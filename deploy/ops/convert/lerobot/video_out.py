"""One camera's pictures as an mp4 of constant rate, by PyAV (extra `export`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from common.errors import RecordingError

CODECS = ("libx264", "mpeg4")
"""The first that PyAV's build has. x264 stands under the GPL, so tandem needs no build with it."""


class VideoOut:
    """Encodes pictures of one size; a picture of another (a thin link halves them) is scaled to it."""

    def __init__(self, path: Path, fps: int, width: int, height: int) -> None:
        """Raises ModuleNotFoundError without the extra `export`, RecordingError without a codec."""
        import av

        path.parent.mkdir(parents=True, exist_ok=True)
        codec = next((name for name in CODECS if name in av.codecs_available), None)
        if codec is None:
            raise RecordingError(f"PyAV has none of {', '.join(CODECS)}: no video can be written")
        self.codec = {"libx264": "h264"}.get(codec, codec)
        self.width, self.height = width, height
        self._container = av.open(str(path), "w")
        stream = self._container.add_stream(codec, rate=fps)
        if not isinstance(stream, av.VideoStream):
            raise RecordingError(f"PyAV takes {codec} for no video codec")
        self._stream = stream
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        # a key frame each second picture: a model reads single frames at random
        self._stream.gop_size = 2
        self._frame_of = av.VideoFrame.from_ndarray
        self.count = 0

    def put(self, jpeg: bytes) -> NDArray[np.uint8]:
        """One picture; the same again where nothing newer had arrived. Returns it as (H, W, 3) RGB."""
        rgb: NDArray[np.uint8] = simplejpeg.decode_jpeg(jpeg)
        frame = self._frame_of(rgb, format="rgb24")
        if (frame.width, frame.height) != (self.width, self.height):
            frame = frame.reformat(self.width, self.height)
        frame.pts = self.count
        self.count += 1
        for packet in self._stream.encode(frame):
            self._container.mux(packet)
        return rgb

    def close(self) -> None:
        """Write what the encoder still holds."""
        for packet in self._stream.encode():
            self._container.mux(packet)
        self._container.close()
