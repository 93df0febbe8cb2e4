"""The newest picture of a robot's camera, and which the operator had at a given time. Pure."""

from __future__ import annotations

from collections import deque

from common.clock import to_ns
from common.errors import CodecError
from common.metrics.master import VideoReceived
from common.wire.video import VideoFrame, decode_frame

_SILENT_S = 2.0
"""After so long any number is believed again: the robot may have started anew."""


class VideoWatch:
    """Keeps the newest frame. What comes twice or late is counted, and changes nothing."""

    def __init__(self) -> None:
        self.frame: VideoFrame | None = None
        self.received = 0
        self.undecodable = 0
        self.late = 0
        self._arrivals: deque[tuple[int, int]] = deque(maxlen=32)

    def on_payload(self, payload: bytes, arrived_ns: int) -> None:
        """Take what came on the video topic, ns of this host's clock."""
        try:
            frame = decode_frame(payload)
        except CodecError:
            self.undecodable += 1
            return
        self.received += 1
        silent = not self._arrivals or arrived_ns - self._arrivals[-1][1] > to_ns(_SILENT_S)
        if self.frame is not None and frame.number <= self.frame.number and not silent:
            self.late += 1
            return
        self.frame = frame
        self._arrivals.append((frame.number, arrived_ns))

    def seen_by(self, sampled_ns: int) -> tuple[int, int]:
        """Number and arrival of the newest frame here when the posture was sampled; (0, 0) if none."""
        for number, arrived_ns in reversed(self._arrivals):
            if arrived_ns <= sampled_ns:
                return number, arrived_ns
        return 0, 0

    def metrics(self) -> VideoReceived:
        """Counters."""
        return VideoReceived(self.received, self.late, self.undecodable)
