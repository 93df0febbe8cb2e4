"""The two ends of the clock exchange, both measuring from the same messages. Pure.

The master asks (t1), the slave hears (t2) and replies (t3), the master hears (t4). The master's next query
carries t1 and t4, so the slave has an exchange of its own: its reply left at t3, was heard at t4, and the
next query left at t1' and arrived at t2'.
"""

from __future__ import annotations

from common.clock import NS_PER_S
from common.messages import ClockQuery, ClockReply
from common.offset.estimator import OffsetEstimator

REMEMBERED = 16
"""Exchanges that may be under way, or lost, before one is forgotten."""
QUIET_NS = NS_PER_S
"""Silence of the master that is followed, after which another may be."""


class MasterExchange:
    """The side that asks. `estimator` gives the slave's clock minus the master's."""

    def __init__(self, estimator: OffsetEstimator | None = None) -> None:
        self.estimator = estimator or OffsetEstimator()
        self.foreign = 0
        """Replies to questions that were not asked, or answered before."""
        self._asked: dict[int, None] = {}
        self._last = (0, 0)

    def query(self, now_ns: int) -> ClockQuery:
        """The next question."""
        self._asked[now_ns] = None
        _forget_oldest(self._asked)
        asked_ns, heard_ns = self._last
        return ClockQuery(now_ns, asked_ns, heard_ns)

    def on_reply(self, reply: ClockReply, arrived_ns: int) -> bool:
        """Take a reply; False if it was none of ours, or its stamps cannot be."""
        if reply.asked_ns not in self._asked:
            self.foreign += 1
            return False
        del self._asked[reply.asked_ns]
        if not self.estimator.add(reply.asked_ns, reply.received_ns, reply.replied_ns, arrived_ns):
            return False
        self._last = (reply.asked_ns, arrived_ns)
        return True


class SlaveExchange:
    """The side that replies. `estimator` gives the master's clock minus the slave's.

    Anyone is answered, but only one asker is measured, or two hosts' clocks would be mixed. It is known by
    its queries, each of which names one before. When it has been quiet for a second, the next asker is
    followed; if its clock is another one, the estimator notices the step and begins anew.
    """

    def __init__(self, estimator: OffsetEstimator | None = None) -> None:
        self.estimator = estimator or OffsetEstimator()
        self.foreign = 0
        """Queries of others than the asker that is followed."""
        self._replied: dict[int, int] = {}
        self._followed_ns: int | None = None

    def on_query(self, query: ClockQuery, received_ns: int, now_ns: int) -> ClockReply:
        """The reply to a query that arrived at `received_ns` and is answered at `now_ns`."""
        # 0 means that there was none before
        replied_ns = self._replied.get(query.last_asked_ns) if query.last_asked_ns else None
        if replied_ns is not None:
            self.estimator.add(replied_ns, query.last_heard_ns, query.asked_ns, received_ns)
        elif self._followed_ns is None or received_ns - self._followed_ns > QUIET_NS:
            self._replied.clear()
        else:
            self.foreign += 1
            return ClockReply(query.asked_ns, received_ns, now_ns)
        self._followed_ns = received_ns
        self._replied[query.asked_ns] = now_ns
        _forget_oldest(self._replied)
        return ClockReply(query.asked_ns, received_ns, now_ns)


def _forget_oldest(remembered: dict[int, int] | dict[int, None]) -> None:
    while len(remembered) > REMEMBERED:
        del remembered[next(iter(remembered))]
