"""What should have come into a recording and did not, by the messages' own numbers. Pure."""

from __future__ import annotations

from common.clock import to_s
from common.latency.arrivals import Arrivals
from common.wire.numbering import Number, number_of
from common.wire.topics import COMMAND

STREAMS = 64
"""Counted side by side, and so many only: each lease and each start of a robot is one."""
ONE = 1
"""The lease in every count: each count already holds one stream."""
SLACK = 1.1
"""A sender may be this much faster than its topic's rate, and still be the one from before."""


class Missing:
    """Counts one topic's messages that are missing between the first and the newest.

    Each stream (a lease, a process) counts for itself. The first message of a new lease goes on where the
    lease before it stopped if its number does: the master counts on when it claims the robot again, and what
    was missed around that is missing too.
    """

    def __init__(self, name: str) -> None:
        """`name`: of the topic. Only commands go on from lease to lease: a state's stream is a process."""
        self._joins = name == COMMAND.name
        self._streams: dict[int, Arrivals] = {}
        self._newest: tuple[Number, int] | None = None
        self._ended = 0
        self.unreadable = 0
        """Messages without a number that could be read: of them nobody knows whether one is missing."""
        self.numbered = 0

    def take(self, payload: bytes, arrived_ns: int) -> None:
        """Look at one message, in the order they came."""
        number = number_of(payload)
        if number is None:
            self.unreadable += 1
            return
        self.numbered += 1
        self._arrivals(number, arrived_ns).note(ONE, number.value)
        self._newest = number, arrived_ns

    def _arrivals(self, number: Number, arrived_ns: int) -> Arrivals:
        known = self._streams.get(number.stream)
        if known is None:
            known = self._before(number, arrived_ns) or Arrivals()
            self._streams[number.stream] = known
            if len(self._streams) > STREAMS:
                oldest = self._streams.pop(next(iter(self._streams)))
                self._ended += 0 if oldest in self._streams.values() else oldest.lost
        return known

    def _before(self, number: Number, arrived_ns: int) -> Arrivals | None:
        if self._newest is None or not self._joins:
            return None
        newest, newest_ns = self._newest
        most = SLACK * COMMAND.rate_hz * to_s(arrived_ns - newest_ns) + 2
        return self._streams[newest.stream] if 0 < number.value - newest.value <= most else None

    @property
    def count(self) -> int | None:
        """How many are missing; None where no number could be read."""
        if not self.numbered:
            return None
        return self._ended + sum(one.lost for one in {id(a): a for a in self._streams.values()}.values())


def missing_in_words(missing: dict[str, int]) -> str:
    """One line for people; empty where nothing is missing."""
    return ", ".join(f"{count} of {name}" for name, count in missing.items() if count)
