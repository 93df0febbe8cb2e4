"""Logs and counts connections, by certificate, and refusals."""

from __future__ import annotations

import logging
from collections import Counter

from common.link.access import named
from common.link.config import LinkConfig
from common.link.link_session import LinkSession
from common.link.refusals import Refusals
from common.link.zenoh_log import hear_refusals
from common.metrics.link import AccessMetrics

log = logging.getLogger(__name__)


class Audit:
    """Make it before the session opens, and `attach` it after. Without [link.tls] it counts nothing."""

    def __init__(self, link: LinkConfig) -> None:
        # a host that only connects admits nobody, so it does not pay for a log line of each message
        guards = bool(link.listen)
        self._refusals: Refusals | None = hear_refusals(messages=guards) if link.tls else None
        self._known = named(link.access) if link.access else None
        self._revoked: frozenset[str] = frozenset()
        self._here: Counter[str] = Counter()
        self._connections: Counter[str] = Counter()
        if self._refusals is not None and self._known is None:
            log.warning(
                "[link.access] is not set: anyone with a certificate of this authority may command the robot"
            )

    def attach(self, session: LinkSession) -> None:
        """Follow which hosts are connected from now on."""
        if self._refusals is not None:
            session.watch_peers(self._on_change)
            session.watch_revoked(self._on_revoked)

    def _on_revoked(self, names: frozenset[str]) -> None:
        self._revoked = names

    def _on_change(self, session_id: str, name: str, here: bool) -> None:
        if self._refusals is not None and name:
            self._refusals.learn(session_id, name)
            if not here:
                self._refusals.went(session_id)
        name = name or f"session {session_id}"
        self._here[name] += 1 if here else -1
        self._connections[name] += here
        if self._here[name] <= 0:
            del self._here[name]
        if not here:
            log.info("%s disconnected", name)
        elif name in self._revoked:
            log.warning("%s connected: its certificate is revoked, so it may do nothing", name)
        elif self._known is not None and name not in self._known:
            log.warning("%s connected: [link.access] does not name it, so it may do nothing", name)
        else:
            log.info("%s connected", name)

    def metrics(self) -> AccessMetrics:
        """For reports."""
        return AccessMetrics(
            connected=dict(self._here),
            connections=dict(self._connections),
            refused=self._refusals.metrics() if self._refusals else None,
        )
