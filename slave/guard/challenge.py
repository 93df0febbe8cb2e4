"""Shows that a request is of now: it must quote a number that the robot gave a moment ago, once.

A request carries no stamp of a clock that the slave could trust, and a person's clock is not measured as the
master's is. So the slave gives a number with each `status`, and counts its age on its own clock.
"""

from __future__ import annotations

from collections import OrderedDict

from common.clock import NS_PER_S, to_s
from slave.guard.lease import DrawToken, random_token

TIMEOUT_NS = 2 * NS_PER_S
"""A challenge older than this is worth nothing: no person waits that long between asking and acting."""
KEPT = 256
"""Challenges remembered; a flood of `status` makes older ones worthless, which moves nothing."""


class Challenges:
    """Numbers given out and not yet quoted, with the time of each."""

    def __init__(self, draw: DrawToken = random_token) -> None:
        self._draw = draw
        self._given_ns: OrderedDict[int, int] = OrderedDict()

    def issue(self, now_ns: int) -> int:
        """Give a new one."""
        challenge = self._draw()
        self._given_ns[challenge] = now_ns
        if len(self._given_ns) > KEPT:
            self._given_ns.popitem(last=False)
        return challenge

    def refusal(self, challenge: int, now_ns: int) -> str | None:
        """Why a request that quotes this one is not of now, or None. It is used up either way."""
        given_ns = self._given_ns.pop(challenge, None)
        if given_ns is None:
            return "the request carries no valid challenge: ask for status first, then repeat it"
        # absolute: an own clock that went back must not make an old request young
        age_ns = abs(now_ns - given_ns)
        if age_ns <= TIMEOUT_NS:
            return None
        return f"the request is late: its challenge is {to_s(age_ns):.1f} s old; ask again"
