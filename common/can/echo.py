"""Whether a frame with an identifier that this side sends is its echo, or comes from a second sender. Pure.

A bus such as udp_multicast gives a sender each of its frames back, once. A frame that comes back more often
than it was sent, or was never sent, comes from a second sender.
"""

from __future__ import annotations

from common.clock import NS_PER_S

KEPT_NS = NS_PER_S
"""An echo comes within this; later, the frames sent are forgotten."""

_Key = tuple[int, bytes]


class SentFrames:
    """The frames that were sent lately and have not come back yet."""

    def __init__(self, comes_back: bool) -> None:
        self._comes_back = comes_back
        self._now: dict[_Key, int] = {}
        self._before: dict[_Key, int] = {}
        self._since_ns = 0
        self._awake_ns = 0
        self._blind_until_ns = 0

    def sent(self, frame_id: int, data: bytes, now_ns: int) -> None:
        """A frame is on its way out."""
        if not self._comes_back:
            return
        self._notice_pause(now_ns)
        if now_ns - self._since_ns > KEPT_NS:
            self._before, self._now, self._since_ns = self._now, {}, now_ns
        key = (frame_id, data)
        self._now[key] = self._now.get(key, 0) + 1

    def is_echo(self, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Whether a frame that is heard is an echo; a second frame like it is not."""
        if not self._comes_back:
            return False
        self._notice_pause(now_ns)
        key = (frame_id, data)
        for sent in (self._before, self._now):
            if left := sent.get(key, 0):
                sent[key] = left - 1
                return True
        # this process stalled: echoes of frames that it has forgotten may arrive now
        return now_ns < self._blind_until_ns

    def _notice_pause(self, now_ns: int) -> None:
        if now_ns - self._awake_ns > KEPT_NS // 2:
            self._blind_until_ns = now_ns + KEPT_NS
        self._awake_ns = now_ns
