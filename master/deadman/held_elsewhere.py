"""A deadman that a person holds on a page of `tandem console`: fresh beats keep it down. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.errors import CodecError
from common.inputs.heartbeat import DeadmanBeat, decode_beat

_AHEAD_NS = to_ns(0.005)
"""Both processes read one clock: a stamp further ahead is none of it."""


class HeldElsewhere:
    """Whether it is held. Counts from the arrival of beats, and from their sending."""

    def __init__(self, timeout_s: float) -> None:
        self.releases = 0
        """How often it went up: a release between two looks is seen, though it is down again."""
        self.refused = 0
        """Datagrams that are no beat, came twice or out of order, or lay in a queue for too long."""
        self._timeout_s = timeout_s
        self._timeout_ns = to_ns(timeout_s)
        self._down: bool | None = None
        self._heard_ns = 0
        self._number = 0
        self._words = "no page of the console has been heard yet"

    def datagram(self, data: bytes, now_ns: int) -> None:
        """Take what arrived at `now_ns`."""
        self.at(now_ns)  # a gap before this beat counts
        try:
            beat = decode_beat(data)
        except CodecError:
            self.refused += 1
            return
        # a console that was started anew counts from 1: it is believed once the last one is silent
        stale = beat.number <= self._number and self._down is not None
        if stale or not self._fresh(beat, now_ns):
            self.refused += 1
            return
        self.releases += bool(self._down) and not beat.down
        self._down, self._heard_ns, self._number = beat.down, now_ns, beat.number

    def at(self, now_ns: int) -> bool | None:
        """Whether it is down now; None while nobody can know."""
        if self._down is not None and now_ns - self._heard_ns > self._timeout_ns:
            self.releases += self._down
            self._down = None
            self._words = f"the console has been silent for {self._timeout_s:g} s"
        return self._down

    @property
    def words(self) -> str:
        """Why it is not known; empty where it is."""
        return self._words if self._down is None else ""

    def left_ns(self, now_ns: int) -> int | None:
        """For how long it is still held if no beat comes; None where it is not held."""
        return self._heard_ns + self._timeout_ns - now_ns if self._down else None

    def _fresh(self, beat: DeadmanBeat, now_ns: int) -> bool:
        return -_AHEAD_NS <= now_ns - beat.sent_ns <= self._timeout_ns
