"""The newest pictures of a robot's cameras, and which the operator had at a given time. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import fields

from common.clock import to_ns
from common.errors import CodecError
from common.metrics.master import VideoReceived
from common.wire.video import FrameChain, VideoFrame, decode_frame

MOST_CAMERAS = 3
_SILENT_S = 2.0
"""After so long any number is believed again: the robot may have started anew."""
_ASK_AGAIN_S = 0.3
"""A request for a picture that stands alone may be lost, or on its way."""


class VideoWatch:
    """Keeps the newest frame that can be shown. What comes twice or late is counted, and changes nothing.

    A picture of H.264 whose predecessor was lost is not one that the operator has: it is not acknowledged.
    """

    def __init__(self) -> None:
        self.frame: VideoFrame | None = None
        self.received = 0
        self.undecodable = 0
        self.late = 0
        self._arrivals: deque[tuple[int, int]] = deque(maxlen=32)
        self._heard_ns: int | None = None
        self._chain = FrameChain()
        self._asked_ns: int | None = None

    def on_payload(self, payload: bytes, arrived_ns: int) -> None:
        """Take what came on the video topic, ns of this host's clock."""
        try:
            frame = decode_frame(payload)
        except CodecError:
            self.undecodable += 1
            return
        self.received += 1
        silent = self._heard_ns is None or arrived_ns - self._heard_ns > to_ns(_SILENT_S)
        if self.frame is not None and frame.number <= self.frame.number and not silent:
            self.late += 1
            return
        self._heard_ns = arrived_ns
        if not self._chain.take(frame):
            return
        self.frame = frame
        self._arrivals.append((frame.number, arrived_ns))

    def seen_by(self, sampled_ns: int) -> tuple[int, int]:
        """Number and arrival of the newest frame here when the posture was sampled; (0, 0) if none."""
        for number, arrived_ns in reversed(self._arrivals):
            if arrived_ns <= sampled_ns:
                return number, arrived_ns
        return 0, 0

    def asks_for_key(self, now_ns: int) -> bool:
        """Whether to ask now for a picture that stands alone; True once, and again while none has come."""
        if not self._chain.wants_key:
            self._asked_ns = None
            return False
        if self._asked_ns is not None and now_ns - self._asked_ns < to_ns(_ASK_AGAIN_S):
            return False
        self._asked_ns = now_ns
        return True

    def metrics(self) -> VideoReceived:
        """Counters."""
        return VideoReceived(self.received, self.late, self.undecodable, self._chain.broken)


class CamerasWatch:
    """All cameras of one robot: each command acknowledges a picture of the next one that has a new one.

    A camera that stands still takes no turn, so the others' pictures are acknowledged as often as before.
    """

    def __init__(self) -> None:
        self._cameras: dict[str, VideoWatch] = {}
        self._told: dict[str, int] = {}
        """By camera, the number of the picture that was acknowledged last."""
        self._turn: list[str] = []
        """The cameras, the one that has waited longest first."""

    def on_payload(self, key: str, payload: bytes, arrived_ns: int) -> None:
        """Take what came on the video topic of one camera."""
        name = key.rpartition("/")[2]
        if name not in self._cameras:
            if len(self._cameras) >= MOST_CAMERAS:
                return
            self._cameras[name] = VideoWatch()
            self._turn.append(name)
        self._cameras[name].on_payload(payload, arrived_ns)

    def seen_by(self, sampled_ns: int) -> tuple[int, int]:
        """Number and arrival of one camera's newest frame when the posture was sampled; (0, 0) if none."""
        seen = {name: self._cameras[name].seen_by(sampled_ns) for name in self._turn}
        new = [name for name, (number, _) in seen.items() if number and number != self._told.get(name)]
        old = [name for name, (number, _) in seen.items() if number]
        if not old:
            return 0, 0
        name = (new or old)[0]
        self._turn.remove(name)
        self._turn.append(name)
        self._told[name] = seen[name][0]
        return seen[name]

    def asks_for_key(self, now_ns: int) -> list[str]:
        """The cameras to ask now for a picture that stands alone."""
        return [name for name, watch in self._cameras.items() if watch.asks_for_key(now_ns)]

    def metrics(self) -> VideoReceived:
        """Counters, of all cameras together."""
        all_ = [watch.metrics() for watch in self._cameras.values()]
        names = [one.name for one in fields(VideoReceived)]
        return VideoReceived(*(sum(getattr(one, name) for one in all_) for name in names))
