"""Opus by PyAV (extra `voice`): 20 ms of one channel at 48 kHz, some 60 bytes."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from av.audio.codeccontext import AudioCodecContext

RATE_HZ = 48_000
FRAME = 960
"""Samples of 20 ms."""
BITS_PER_S = 24_000
Samples = NDArray[np.int16]
"""(FRAME,)"""
FADES = (0.6, 0.3, 0.1)
"""Of the last frame heard, in place of the first, second and third that are missing; then silence."""


class OpusEncoder:
    """One voice that is sent."""

    def __init__(self) -> None:
        """Raises ModuleNotFoundError without PyAV."""
        import av

        self._av = av
        self._codec = _audio("libopus", "w")
        self._codec.sample_rate, self._codec.layout, self._codec.format = RATE_HZ, "mono", "s16"
        self._codec.bit_rate = BITS_PER_S
        self._codec.options = {"application": "voip", "frame_duration": "20", "packet_loss": "5"}
        self._count = 0

    def encode(self, samples: Samples) -> bytes:
        """20 ms."""
        frame = self._av.AudioFrame.from_ndarray(samples.reshape(1, -1), format="s16", layout="mono")
        frame.sample_rate, frame.time_base, frame.pts = RATE_HZ, Fraction(1, RATE_HZ), self._count * FRAME
        self._count += 1
        return b"".join(bytes(packet) for packet in self._codec.encode(frame))


class OpusDecoder:
    """One voice that is heard, with what is missing concealed."""

    def __init__(self) -> None:
        """Raises ModuleNotFoundError without PyAV."""
        import av

        self._av = av
        self._codec = _audio("libopus", "r")
        self._codec.sample_rate, self._codec.layout = RATE_HZ, "mono"
        self._last: Samples = silence()
        self._missing = 0
        self.undecodable = 0

    def decode(self, body: bytes) -> Samples:
        """20 ms; concealed where the packet is damaged."""
        try:
            frames = self._codec.decode(self._av.Packet(body))
        except self._av.FFmpegError:
            frames = []
        if len(frames) != 1 or frames[0].samples != FRAME:
            self.undecodable += 1
            return self.conceal()
        self._last = frames[0].to_ndarray().reshape(-1).astype(np.int16)
        self._missing = 0
        return self._last

    def conceal(self) -> Samples:
        """20 ms in place of what is missing: the last frame, fading, then silence."""
        self._missing += 1
        if self._missing > len(FADES):
            return silence()
        faded: Samples = (self._last * FADES[self._missing - 1]).astype(np.int16)
        return faded


def silence() -> Samples:
    """20 ms of it."""
    return np.zeros(FRAME, np.int16)


def _audio(name: str, mode: str) -> AudioCodecContext:
    import av

    context = av.CodecContext.create(name, "w" if mode == "w" else "r")
    assert isinstance(context, av.AudioCodecContext)
    return context
