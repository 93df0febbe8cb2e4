"""Puts packets of a voice in order and gives one every 20 ms, as soon as the link's jitter allows. Pure.

The depth follows the jitter of the last packets. What comes after its turn is dropped, and so is what waits
when too much does: an old word is never played after a pause of the link, it is counted.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from common.clock import NS_PER_MS
from common.wire.voice import VoicePacket

FRAME_NS = 20 * NS_PER_MS
LEAST_FRAMES, MOST_FRAMES = 2, 10
"""Of the depth that is aimed at: 40 to 200 ms."""
_SHARE = 0.95
_MEASURED = 250
"""Packets whose delays are remembered: 5 s."""
_SLACK = 2
"""Frames beyond the depth before it is shortened, one frame at a time."""
_TOO_MANY = 8
"""Frames beyond the depth at which all that is older is dropped at once."""
_SHORTEN_EVERY = 10
_DRY_FRAMES = 5
"""Frames without any packet after which it begins anew."""


@dataclass(slots=True)
class VoiceCounters:
    """What became of packets."""

    received: int = 0
    played: int = 0
    late: int = 0
    """Came after their turn."""
    stale: int = 0
    """Waited too long, because too many did."""
    missing: int = 0
    """Frames that were due and not there."""


class JitterBuffer:
    """The packets of one stream."""

    def __init__(self) -> None:
        self.counters = VoiceCounters()
        self._stream = 0
        self._waiting: dict[int, bytes] = {}
        self._next: int | None = None
        self._delays_ns: deque[int] = deque(maxlen=_MEASURED)
        self._dry = 0
        self._since_shortened = 0

    @property
    def depth(self) -> int:
        """Frames that should wait."""
        if not self._delays_ns:
            return LEAST_FRAMES
        ordered = sorted(self._delays_ns)
        jitter_ns = ordered[min(len(ordered) - 1, int(_SHARE * len(ordered)))] - ordered[0]
        return min(max(math.ceil(jitter_ns / FRAME_NS) + 1, LEAST_FRAMES), MOST_FRAMES)

    @property
    def waiting(self) -> int:
        """Frames that do wait."""
        return len(self._waiting)

    def put(self, packet: VoicePacket, arrived_ns: int) -> None:
        """A packet with a body came."""
        self.counters.received += 1
        if packet.stream != self._stream:
            self._begin(packet.stream)
        self._delays_ns.append(arrived_ns - packet.sequence * FRAME_NS)
        if self._next is not None and packet.sequence < self._next:
            self.counters.late += 1
            return
        self._waiting[packet.sequence] = packet.body
        if len(self._waiting) > self.depth + _TOO_MANY:
            self._drop_to(self.depth)

    def take(self) -> bytes | None:
        """What is due now, once every 20 ms; None: nothing, or it is missing (`speaking` says which)."""
        if self._next is None:
            if len(self._waiting) < self.depth:
                return None
            self._next = min(self._waiting)
        self._shorten()
        body = self._waiting.pop(self._next, None)
        if body is not None:
            self._next += 1
            self._dry = 0
            self.counters.played += 1
            return body
        self.counters.missing += 1
        if self._waiting:
            self._next += 1  # lost: those after it are here
            return None
        self._dry += 1
        if self._dry >= _DRY_FRAMES:
            self.pause()
        return None

    @property
    def speaking(self) -> bool:
        """Whether frames are due: one that is not there is concealed."""
        return self._next is not None

    def pause(self) -> None:
        """Nothing more is said: the next packet begins anew."""
        self._next, self._dry = None, 0
        self._waiting.clear()

    def _begin(self, stream: int) -> None:
        self._stream = stream
        self._delays_ns.clear()
        self.pause()

    def _shorten(self) -> None:
        """What came late made the line longer for good; one frame at a time it becomes shorter again."""
        self._since_shortened += 1
        if len(self._waiting) > self.depth + _SLACK and self._since_shortened >= _SHORTEN_EVERY:
            self._since_shortened = 0
            self._drop_to(len(self._waiting) - 1)

    def _drop_to(self, most: int) -> None:
        for sequence in sorted(self._waiting)[: max(0, len(self._waiting) - most)]:
            del self._waiting[sequence]
            self.counters.stale += 1
        if self._next is not None and self._waiting:
            self._next = max(self._next, min(self._waiting))
