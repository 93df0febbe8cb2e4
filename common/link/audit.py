"""Who is connected, by certificate, and who was refused: logged, and counted for reports."""

from __future__ import annotations

import logging
from collections import Counter

from common.link.access import named
from common.link.config import LinkConfig
from common.link.refusals import Refusals
from common.link.session import LinkSession
from common.link.zenoh_log import hear_refusals
from common.metrics.link import AccessMetrics

log = logging.getLogger(__name__)


class Audit:
    """Make it before the session opens, and `attach` it after. Without [link.tls] it hears nothing."""

    def __init__(self, link: LinkConfig) -> None:
        # who only connects lets nobody in: it need not pay for hearing of each message
        guards = bool(link.listen)
        self._refusals: Refusals | None = hear_refusals(messages=guards) if link.tls else None
        self._known = named(link.access) if link.access else None
        self._here: Counter[str] = Counter()
        self._connections: Counter[str] = Counter()
        if self._refusals is not None and self._known is None:
            log.warning(
                "[link.access] is not set: anyone with a certificate of this authority may command the robot"
            )

    def attach(self, session: LinkSession) -> None:
        """Hear of everybody who is connected, and who comes and goes."""
        if self._refusals is not None:
            session.watch_peers(self._on_change)

    def _on_change(self, session_id: str, who: str, here: bool) -> None:
        if self._refusals is not None and who:
            self._refusals.learn(session_id, who)
            if not here:
                self._refusals.went(session_id)
        who = who or f"session {session_id}"
        self._here[who] += 1 if here else -1
        self._connections[who] += here
        if self._here[who] <= 0:
            del self._here[who]
        if not here:
            log.info("%s disconnected", who)
        elif self._known is not None and who not in self._known:
            log.warning("%s connected: [link.access] does not name it, so it may do nothing", who)
        else:
            log.info("%s connected", who)

    def metrics(self) -> AccessMetrics:
        """For reports."""
        return AccessMetrics(
            connected=dict(self._here),
            connections=dict(self._connections),
            refused=self._refusals.metrics() if self._refusals else None,
        )
