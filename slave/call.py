"""Whether somebody at the robot waits for an operator, and since when. Pure: time is given.

A call is answered when an operator's master claims the robot, and withdrawn by the person who made it.
It moves nothing.
"""

from __future__ import annotations

from common.clock import to_s
from common.wire.call import CallReply, CallRequest
from common.wire.summary import HomeCall


class Call:
    """The robot's one place in the queue: calling twice keeps the first call's time."""

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._words = ""
        self.made = 0
        self.answered = 0
        self.withdrawn = 0

    @property
    def waits(self) -> bool:
        """Whether somebody waits."""
        return self._since_ns is not None

    def take(self, request: CallRequest, operator: str, now_ns: int) -> CallReply:
        """Answer a person at the robot. `operator`: who holds the lease; empty: nobody."""
        if not request.calls:
            if self._since_ns is None:
                return CallReply(True, "nobody was called")
            self._since_ns, self._words = None, ""
            self.withdrawn += 1
            return CallReply(True, "the call is withdrawn")
        if operator:
            return CallReply(True, f"{operator} commands this robot already")
        if self._since_ns is not None:
            self._words = request.words or self._words
            waited_s = to_s(now_ns - self._since_ns)
            return CallReply(True, f"an operator has been called for {waited_s:.0f} s; nobody has come yet")
        self._since_ns, self._words = now_ns, request.words
        self.made += 1
        return CallReply(True, "an operator is called; operators see it in their list of robots")

    def look(self, operator: str) -> bool:
        """Note who holds the lease now; True where that has just answered the call."""
        if self._since_ns is None or not operator:
            return False
        self._since_ns, self._words = None, ""
        self.answered += 1
        return True

    def shown(self, now_ns: int) -> HomeCall | None:
        """For the summary; None: nobody waits."""
        if self._since_ns is None:
            return None
        return HomeCall(max(0.0, to_s(now_ns - self._since_ns)), self._words)
