"""One operator at a time: a lease that is granted, renewed by accepted commands, and never stolen."""

from __future__ import annotations

import secrets
from collections.abc import Callable

from common.clock import to_s
from common.metrics.slave import LeaseMetrics
from common.wire.lease import lease_id

DrawToken = Callable[[], int]
"""Draws a new unpredictable token, 1 to 2⁶³ - 1. Tests pass a counter."""


def random_token() -> int:
    """A token from the system's random source; 0 is kept for "no lease"."""
    return 1 + secrets.randbelow(2**63 - 1)


class Lease:
    """The right to move the robot. All times are the slave's own; a lease that has lapsed never revives."""

    def __init__(self, timeout_ns: int, draw_token: DrawToken = random_token) -> None:
        self._timeout_ns = timeout_ns
        self._draw_token = draw_token
        self._granted_ns = self._renewed_ns = 0
        self.operator = ""
        """The holder's name; empty: none."""
        self.token = 0
        """The holder's token; 0: none."""

    def claim(self, operator: str, now_ns: int) -> int:
        """The new token, or 0 if any operator holds a current lease, even one of the same name.

        A master that was restarted waits until its own old lease has lapsed.
        """
        self.lapse(now_ns)
        if self.token or not operator:
            return 0
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
        """End the lease."""
        self.operator, self.token = "", 0

    def metrics(self, now_ns: int) -> LeaseMetrics | None:
        """Holder, id, age, and time since a command renewed it; None: no holder."""
        if not self.token:
            return None
        return LeaseMetrics(
            operator=self.operator,
            id=lease_id(self.token),
            held_s=round(to_s(now_ns - self._granted_ns), 3),
            renewed_s=round(to_s(now_ns - self._renewed_ns), 3),
        )
