"""How large the next picture may be, and when it is due: so that video never holds up what matters. Pure.

Additive increase, multiplicative decrease (Chiu and Jain 1989) of a picture's size, steered by the delay
that the picture itself met, as LEDBAT (RFC 6817) does: its transit less that of the clocks' quickest
exchange, which is all but empty. A link keeps what it cannot send at once in a queue, and a state sent behind
a picture waits as long as the picture's last byte. So that wait is what is bounded. Two pictures are under
way at a time, or as many as are due until the next acknowledgement can come. Several cameras divide the wait
and the link's time among them, and each is steered by itself: one that stands still takes nothing of theirs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

LEAST_BYTES = 1500
_MORE_BYTES = 500
_LESS = 0.6
_SLOWER, _FASTER = 1.5, 0.7
_SHARE = 0.5
"""The share of the link's time that the pictures of all cameras may take."""
_COMMAND_S = 0.08
"""From one command, which acknowledges the pictures of one camera, to the next."""
_USED = 0.6
"""A picture that needed less of its budget says nothing about a larger one."""
_LOST_NS = 1_000_000_000
_TOLD_NS = 300_000_000
"""Where no acknowledgement has come yet: after so long a picture that is said to be lost is."""
_PATIENCE = 1.5
"""Acknowledgements that may still come, by how long they took lately."""


@dataclass(frozen=True, slots=True)
class RateLimits:
    """Bounds of what the control may choose."""

    most_rate_hz: float
    least_rate_hz: float
    most_delay_ns: int
    most_bytes: int
    cameras: int = 1
    """How many share the link, and the commands that acknowledge their pictures."""

    @property
    def window(self) -> int:
        """Pictures that may be under way: those due until the next acknowledgement, and one more."""
        return max(2, 1 + math.ceil(self.most_rate_hz * _COMMAND_S * self.cameras))


@dataclass(slots=True)
class _Sent:
    size: int
    sent_ns: int
    budget: float


class RateControl:
    """Pictures under way, and what their acknowledgements teach."""

    def __init__(self, limits: RateLimits) -> None:
        self._limits = limits
        self._fastest_ns = 1e9 / limits.most_rate_hz
        self._slowest_ns = max(1e9 / limits.least_rate_hz, self._fastest_ns)
        self._interval_ns = self._fastest_ns
        self._budget = float(LEAST_BYTES)
        self._under_way: dict[int, _Sent] = {}
        self._told: dict[int, _Sent] = {}
        """Pictures that somebody says are lost; the operator's acknowledgement refutes it."""
        self._told_ns = 0
        self._takes_ns = 0.0
        """How long an acknowledgement takes: the longest lately."""
        self._last_sent_ns: int | None = None
        self._rest_until_ns = 0
        self._lowered_ns = -1
        self.lowered = 0
        """Times that the bitrate was reduced."""
        self.lost = 0
        """Pictures that were not acknowledged."""

    @property
    def budget_bytes(self) -> int:
        """What the next picture may weigh."""
        return int(self._budget)

    def due_ns(self, now_ns: int) -> int | None:
        """When the next picture may be sent; None while as many are under way as may be."""
        self._give_up(now_ns)
        if len(self._under_way) >= self._limits.window:
            return None
        if self._last_sent_ns is None:
            return now_ns
        return max(self._last_sent_ns + round(self._interval_ns), self._rest_until_ns)

    def sent(self, number: int, size: int, now_ns: int) -> None:
        """Note that a picture has been put on the link."""
        self._under_way[number] = _Sent(size, now_ns, self._budget)
        self._last_sent_ns = now_ns

    def seen(self, number: int, now_ns: int, delay_ns: int | None) -> None:
        """The operator's side has received this picture; those before it will not be acknowledged any more.

        `delay_ns`: by how much its transit was longer than an empty packet's on an idle link; None where the
        clocks' offset is not trusted, and then only the number under way is learnt.
        """
        sent = self._under_way.get(number) or self._told.get(number)
        self._under_way = {n: s for n, s in self._under_way.items() if n > number}
        if sent is not None:
            self._takes_ns = max(0.9 * self._takes_ns, float(now_ns - sent.sent_ns))
        if number in self._told:
            self.lost -= len(self._told)
            self._told.clear()
        if sent is None or delay_ns is None:
            return
        self._rest_until_ns = sent.sent_ns + round(self._limits.cameras * delay_ns / _SHARE)
        if delay_ns > self._limits.most_delay_ns:
            if sent.sent_ns > self._lowered_ns:  # what was sent before the last step down taught it already
                self._lower(now_ns)
            return
        self._interval_ns = max(self._interval_ns * _FASTER, self._fastest_ns)
        if sent.size > _USED * sent.budget:
            self._budget = min(self._budget + _MORE_BYTES, float(self._limits.most_bytes))

    def lost_on_way(self, now_ns: int) -> None:
        """Somebody who receives the pictures says that one was lost: the next may be sent at once.

        The request does not tell who asks, and a viewer's bad line is none of the operator's. So the rate
        falls only once the operator has not acknowledged those pictures either.
        """
        if self._under_way:
            self.lost += len(self._under_way)
            if not self._told:
                self._told_ns = now_ns
            self._told |= self._under_way
            self._under_way.clear()

    def _give_up(self, now_ns: int) -> None:
        wait_ns = _PATIENCE * self._takes_ns if self._takes_ns else _TOLD_NS
        if self._told and now_ns - self._told_ns > min(wait_ns, _LOST_NS):
            self._told.clear()
            self._lower(now_ns)
        lost = [n for n, s in self._under_way.items() if now_ns - s.sent_ns > _LOST_NS]
        for number in lost:
            del self._under_way[number]
        if lost:
            self.lost += len(lost)
            self._interval_ns = self._slowest_ns
            self._lower(now_ns)

    def _lower(self, now_ns: int) -> None:
        self.lowered += 1
        self._lowered_ns = now_ns
        if self._budget <= LEAST_BYTES:
            self._interval_ns = min(self._interval_ns * _SLOWER, self._slowest_ns)
        self._budget = max(self._budget * _LESS, float(LEAST_BYTES))
