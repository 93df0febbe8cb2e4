"""The two ends of the clock exchange, both measuring from the same messages. Pure.

The master asks (t1), the slave hears (t2) and replies (t3), the master hears (t4). The master's next query
carries t1 and t4, so the slave has an exchange of its own: its reply left at t3, was heard at t4, and the
next query left at t1' and arrived at t2'.
"""

from __future__ import annotations

from common.clock import NS_PER_S
from common.clock_sync.best import BestOffset
from common.clock_sync.estimator import RAW_CLOCKS, Offset, OffsetEstimator
from common.wire.messages import ClockQuery, ClockReference, ClockReply

REMEMBERED = 16
"""Exchanges that may be under way, or lost, before one is forgotten."""
QUIET_NS = NS_PER_S
"""Silence of the master that is measured, after which another may be, where both ask by one number."""
MOST_ASKERS = 8
"""Measured at a time; beyond it the one heard longest ago is forgotten, but never the one followed."""


class MasterExchange:
    """The side that asks. `estimator` gives the slave's clock minus the master's.

    `asker` is a number that no other process draws; the claim names it too.
    """

    def __init__(self, asker: int = 0) -> None:
        self.asker = asker
        self.estimator = OffsetEstimator(RAW_CLOCKS)
        self.best = BestOffset()
        self.own: ClockReference | None = None
        """What this host's time service states."""
        self.own_steps = 0
        """Times that its reference was set, or jumped."""
        self.foreign = 0
        """Replies to questions that were not asked, or answered before."""
        self._asked: dict[int, None] = {}
        self._last = (0, 0)

    def query(self, now_ns: int) -> ClockQuery:
        """The next question."""
        self._asked[now_ns] = None
        _forget_oldest(self._asked)
        asked_ns, heard_ns = self._last
        return ClockQuery(now_ns, asked_ns, heard_ns, self.asker, self.own)

    def estimate(self, now_ns: int) -> Offset:
        """The offset by the better of the round trip and what the hosts' time services state."""
        return self.best.estimate(now_ns, self.estimator.estimate(now_ns), self.own)

    def tell(self, own: ClockReference | None, steps: int) -> None:
        """What this host's time service states now."""
        self.own, self.own_steps = own, steps

    def on_reply(self, reply: ClockReply, arrived_ns: int) -> bool:
        """Take a reply; False if it answers no question of this side, or its stamps are impossible."""
        if reply.asked_ns not in self._asked:
            self.foreign += 1
            return False
        del self._asked[reply.asked_ns]
        if not self.estimator.add(reply.asked_ns, reply.received_ns, reply.replied_ns, arrived_ns):
            return False
        self._last = (reply.asked_ns, arrived_ns)
        self.best.heard(reply.reference, arrived_ns)
        return True


class SlaveExchange:
    """The side that replies. `estimator` gives the clock of the asker that is followed minus the slave's.

    Anyone is answered. Each asker is measured by itself, or two hosts' clocks would be mixed, and the one
    that is followed is the one that was granted the lease: a second operator who waits, or one who was there
    first, neither disturbs it nor keeps it from being measured.
    """

    def __init__(self) -> None:
        self.foreign = 0
        """Queries of others than the asker that is followed."""
        self.own: ClockReference | None = None
        """What this host's time service states."""
        self.own_steps = 0
        """Times that its reference was set, or jumped."""
        self._followed = 0
        self._askers = {0: _Asker()}

    @property
    def estimator(self) -> OffsetEstimator:
        """Of the asker that is followed."""
        return self._askers[self._followed].estimator

    @property
    def best(self) -> BestOffset:
        """What bounds the offset of the asker that is followed, and why."""
        return self._askers[self._followed].best

    def estimate(self, now_ns: int) -> Offset:
        """The offset by the better of the round trip and what the hosts' time services state.

        For figures and prediction. A gate of the guard takes `estimator`: that is proved, this is believed.
        """
        return self.best.estimate(now_ns, self.estimator.estimate(now_ns), self.own)

    def tell(self, own: ClockReference | None, steps: int) -> None:
        """What this host's time service states now."""
        self.own, self.own_steps = own, steps

    def follow(self, asker: int) -> None:
        """From now on commands bear the stamps of this asker's clock."""
        self._followed = asker
        self._heard(asker)

    def on_query(self, query: ClockQuery, received_ns: int, now_ns: int) -> ClockReply:
        """The reply to a query that arrived at `received_ns` and is answered at `now_ns`."""
        taken = self._heard(query.asker).on_query(query, received_ns, now_ns)
        if not taken or query.asker != self._followed:
            self.foreign += 1
        return ClockReply(query.asked_ns, received_ns, now_ns, reference=self.own)

    def _heard(self, asker: int) -> _Asker:
        known = self._askers.pop(asker, None) or _Asker()
        self._askers[asker] = known
        if len(self._askers) > MOST_ASKERS:
            del self._askers[next(a for a in self._askers if a != self._followed)]
        return known


class _Asker:
    """One asker's exchanges.

    It is known by its queries too, each of which names one before: so those that share a number, as all that
    have none do, are not mixed. When the one that is measured has been quiet for a second, the next is; if
    its clock is another one, the estimator notices the step and begins anew.
    """

    def __init__(self) -> None:
        self.estimator = OffsetEstimator(RAW_CLOCKS)
        self.best = BestOffset()
        self._replied: dict[int, int] = {}
        self._measured_ns: int | None = None

    def on_query(self, query: ClockQuery, received_ns: int, now_ns: int) -> bool:
        """Whether the query is one of the asker's that is measured."""
        # 0 means that there was none before
        replied_ns = self._replied.get(query.last_asked_ns) if query.last_asked_ns else None
        if replied_ns is not None:
            self.estimator.add(replied_ns, query.last_heard_ns, query.asked_ns, received_ns)
        elif self._measured_ns is None or received_ns - self._measured_ns > QUIET_NS:
            self._replied.clear()
        else:
            return False
        self._measured_ns = received_ns
        self.best.heard(query.reference, received_ns)
        # a query that the network doubled is replied to twice, and the first reply is the one that counts
        self._replied.setdefault(query.asked_ns, now_ns)
        _forget_oldest(self._replied)
        return True


def _forget_oldest(remembered: dict[int, int] | dict[int, None]) -> None:
    while len(remembered) > REMEMBERED:
        del remembered[next(iter(remembered))]
