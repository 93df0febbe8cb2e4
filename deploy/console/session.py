"""Who may do what on the page: hosts and origins, one-time tokens, sessions, rates. Pure.

A page that a browser opened elsewhere must not reach the console through that browser: requests for another
host's name, and posts and sockets from another origin, are refused on loopback too.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from common.clock import to_ns

SESSION_S = 12 * 3600.0
TOKEN_S = 12 * 3600.0
MOST_SESSIONS = 32
Draw = Callable[[], str]
"""Draws a secret."""


class PageRole(StrEnum):
    """What the person at a page may do. To stop the robot needs none."""

    NOBODY = "nobody"
    """Beyond this host without a log-in: sees nothing, and may stop."""
    VIEWER = "viewer"
    OPERATOR = "operator"
    ENGINEER = "engineer"

    @property
    def sees(self) -> bool:
        """Whether the page shows the robot."""
        return self is not PageRole.NOBODY

    @property
    def acts(self) -> bool:
        """Whether the page may do more than stop."""
        return self in (PageRole.OPERATOR, PageRole.ENGINEER)


@dataclass(frozen=True, slots=True)
class Person:
    """Who sits at a page, as far as the console knows."""

    role: PageRole
    name: str = ""


@dataclass(frozen=True, slots=True)
class _Ticket:
    """A token that was not used yet, or a session."""

    person: Person
    until_ns: int


class Access:
    """Tokens and sessions of one console process. A restart ends them all."""

    def __init__(
        self, names: Iterable[str], secure: bool, stranger: PageRole, draw: Draw | None = None
    ) -> None:
        """`names`: `host:port` by which browsers may reach it. `stranger`: the role without a log-in."""
        self._names = frozenset(name.lower() for name in names)
        self._scheme = "https" if secure else "http"
        self._stranger = Person(stranger)
        self._draw = draw or (lambda: secrets.token_urlsafe(24))
        self._tokens: dict[str, _Ticket] = {}
        self._sessions: dict[str, _Ticket] = {}
        self.refused: dict[str, int] = {}
        """Requests that were refused, by reason."""

    def issue(self, person: Person, now_ns: int) -> str:
        """A token with which somebody may log in once."""
        self._tokens = {token: ticket for token, ticket in self._tokens.items() if now_ns <= ticket.until_ns}
        token = self._draw()
        self._tokens[token] = _Ticket(person, now_ns + to_ns(TOKEN_S))
        return token

    def log_in(self, token: str, now_ns: int) -> tuple[str, Person] | None:
        """A session's secret and its person; None where the token is wrong, used or too old."""
        found = None
        for known in list(self._tokens):
            # each is compared, in constant time
            if hmac.compare_digest(known.encode(), token.encode()):
                found = self._tokens.pop(known)
        if found is None or now_ns > found.until_ns:
            return None
        return self.enter(found.person, now_ns), found.person

    def enter(self, person: Person, now_ns: int) -> str:
        """Begin a session of a person who is known otherwise; its secret."""
        while len(self._sessions) >= MOST_SESSIONS:
            self._sessions.pop(next(iter(self._sessions)))
        secret = self._draw()
        self._sessions[secret] = _Ticket(person, now_ns + to_ns(SESSION_S))
        return secret

    def lives(self, secret: str, now_ns: int) -> bool:
        """Whether it is a session's that has not expired."""
        return self.person(secret, now_ns) is not self._stranger

    def log_out(self, secret: str) -> None:
        """End a session."""
        self._sessions.pop(secret, None)

    def person(self, secret: str, now_ns: int) -> Person:
        """Whose session it is; a stranger where it is none, or has expired."""
        ticket = self._sessions.get(secret)
        if ticket is None:
            return self._stranger
        if now_ns > ticket.until_ns:
            del self._sessions[secret]
            return self._stranger
        return ticket.person

    def wrong_host(self, host: str) -> str:
        """Why a request for this host is refused; empty where it is not."""
        if host.lower() in self._names:
            return ""
        return self._refuse(
            "host", f"this console is not {host[:80] or 'a host without a name'}: see [console] names"
        )

    def wrong_origin(self, origin: str, host: str) -> str:
        """Why a post or a socket from this origin is refused; empty where it is not."""
        if origin.lower() == f"{self._scheme}://{host.lower()}" and host.lower() in self._names:
            return ""
        return self._refuse("origin", f"a page of {origin[:80] or 'no origin'} may not use this console")

    def _refuse(self, reason: str, words: str) -> str:
        self.refused[reason] = self.refused.get(reason, 0) + 1
        return words

    def count_refusal(self, reason: str) -> None:
        """Count a refusal that was decided elsewhere."""
        self._refuse(reason, "")


class RateLimit:
    """At most so many a second, and as many at once (a token bucket)."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._left = per_s
        self._at_ns: int | None = None

    def passes(self, now_ns: int) -> bool:
        """Whether one more may pass now."""
        if self._at_ns is not None:
            self._left = min(self._per_s, self._left + self._per_s * (now_ns - self._at_ns) * 1e-9)
        self._at_ns = now_ns
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
