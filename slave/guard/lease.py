"""One operator at a time: a lease is granted, renewed by accepted commands, handed over, never stolen."""

from __future__ import annotations

import secrets
from collections.abc import Callable

from common.clock import NS_PER_S, to_ns, to_s
from common.metrics.slave import LeaseMetrics
from common.wire.lease import lease_id

WANTED_S = 10.0
"""For so long an operator's wish to command the robot counts. The operator's master claims it at once."""
DrawToken = Callable[[], int]
"""Draws a new unpredictable token, 1 to 2⁶³ - 1. Tests pass a counter."""


def random_token() -> int:
    """A token from the system's random source; 0 is kept for "no lease"."""
    return 1 + secrets.randbelow(2**63 - 1)


class Lease:
    """The right to move the robot. All times are the slave's own; a lease that has lapsed never revives."""

    def __init__(
        self, timeout_ns: int, draw_token: DrawToken = random_token, offer_timeout_ns: int = 60 * NS_PER_S
    ) -> None:
        self._timeout_ns = timeout_ns
        self._offer_timeout_ns = offer_timeout_ns
        self._offered_ns = 0
        self.offered_to = ""
        """The operator to whom the holder offers it; empty: nobody."""
        self._draw_token = draw_token
        self._granted_ns = self._renewed_ns = 0
        self.operator = ""
        """The holder's name; empty: none."""
        self.token = 0
        """The holder's token; 0: none."""
        self.let_go_by = ""
        """Who gave it back last; empty once it was claimed again."""
        self._wanted_by = ""
        self._wanted_ns = 0

    def claim(self, operator: str, now_ns: int) -> int:
        """The new token, or 0 if an operator, even of the same name, holds a lease and does not offer it.

        A master that was restarted waits until its own old lease has lapsed.
        """
        self.lapse(now_ns)
        self.lapse_offer(now_ns)
        if not operator or (self.token and operator != self.offered_to):
            return 0
        self.drop()
        self.let_go_by = self._wanted_by = ""
        self.operator, self.token = operator, self._draw_token()
        self._granted_ns = self._renewed_ns = now_ns
        return self.token

    def renew(self, arrived_ns: int) -> None:
        """Count the time-out anew from the arrival of an accepted command."""
        self._renewed_ns = max(self._renewed_ns, arrived_ns)

    def lapse(self, now_ns: int) -> bool:
        """Drop the lease if it has not been renewed in time; True if that ended one.

        A clock that went back by more than the time-out ends it as well: hold on doubt.
        """
        # written as a fact to be given up, so that a clock coming past again cannot revive it
        if not self.token or abs(now_ns - self._renewed_ns) <= self._timeout_ns:
            return False
        self.drop()
        return True

    def drop(self) -> None:
        """End the lease, and with it an offer."""
        self.operator, self.token, self.offered_to = "", 0, ""

    def want(self, operator: str, now_ns: int) -> None:
        """An operator asks that the own master claim it. It gives no right, and lapses after WANTED_S."""
        self._wanted_by, self._wanted_ns = operator, now_ns

    def wanted_by(self, now_ns: int) -> str:
        """Who has asked for it lately; empty: nobody."""
        return self._wanted_by if 0 <= now_ns - self._wanted_ns <= to_ns(WANTED_S) else ""

    def offer(self, operator: str, now_ns: int) -> None:
        """Offer it to another operator, in place of an earlier offer. Until it is taken its holder has it."""
        self.offered_to, self._offered_ns = operator, now_ns

    def withdraw(self) -> None:
        """Offer it to nobody."""
        self.offered_to = ""

    def lapse_offer(self, now_ns: int) -> str:
        """End an offer that was not taken in time; to whom it was made, empty if none has ended now.

        A clock that went back by more than the time-out ends it as well, as it does the lease.
        """
        if not self.offered_to or abs(now_ns - self._offered_ns) <= self._offer_timeout_ns:
            return ""
        missed, self.offered_to = self.offered_to, ""
        return missed

    def metrics(self, now_ns: int) -> LeaseMetrics | None:
        """Holder, id, age, and time since a command renewed it; None: no holder."""
        if not self.token:
            return None
        return LeaseMetrics(
            operator=self.operator,
            id=lease_id(self.token),
            held_s=round(to_s(now_ns - self._granted_ns), 3),
            renewed_s=round(to_s(now_ns - self._renewed_ns), 3),
            offered_to=self.offered_to,
            offer_left_s=round(to_s(self._offered_ns + self._offer_timeout_ns - now_ns), 1)
            if self.offered_to
            else 0.0,
        )
