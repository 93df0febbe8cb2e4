"""Refused connections and messages, read from Zenoh's log, since Zenoh reports them nowhere else. Pure.

A handshake is refused with a reason, before the name of the other side is known. The access control refuses a
message: its log line names the certificate the first time and the session's id from then on, and the same
thread's next line says that the message was dropped.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

from common.clock import to_ns
from common.log.throttle import LogThrottle
from common.metrics.link import RefusalMetrics

REPEAT_S = 10.0
"""A refusal that repeats itself is logged once in this time."""
MAX_KINDS = 256
"""Different refusals that are counted one by one; further ones are counted together."""
HANDSHAKES = "error,zenoh_link_tls=warn,zenoh_link_commons=warn"
"""Zenoh's log filter that shows refused handshakes."""
MESSAGES = f"{HANDSHAKES},zenoh::net::routing::interceptor=trace"
"""The filter that shows refused messages too: Zenoh then logs every message, some 20 µs each."""

_HANDSHAKE = (
    re.compile(r"zenoh_link_tls::unicast: (?P<why>.+?)\.? Hint: "),
    re.compile(r'QUIC acceptor failed: .*?reason: "(?P<why>[^"]+)"'),
    re.compile(r"expiration: Closing \w+ link .+? : (?P<why>remote certificate chain expired)"),
)
_NUMBERS = re.compile(r": verification time .*")
_THREAD = re.compile(r"ThreadId\(\d+\)")
_NAMED = re.compile(r"(?P<zid>[0-9a-f]+) on \S*?CertCommonName\((?P<name>[^)]*)\)")
_UNAUTHORIZED = re.compile(
    r"(?P<zid>[0-9a-f]+)(?: on \S+)? is unauthorized to (?P<what>.+?) \(ingress\) on (?P<key>\S+)"
)
_DROPPED = "Msg intercepted!"


@dataclass(frozen=True, slots=True)
class Refusal:
    """One attempt."""

    name: str
    """A common name, or a session's id; empty where the handshake failed, so that no name is proved."""
    what: str
    key: str

    def __str__(self) -> str:
        if not self.name:
            return f"a connection was refused: {self.what}"
        return f"{self.name} was refused: {self.what} {self.key}"


class Refusals:
    """Counts refusals; `feed` takes a line of Zenoh's log and returns what to log about it."""

    def __init__(self) -> None:
        self.counts: Counter[Refusal] = Counter()
        self.more = 0
        """Refusals beyond MAX_KINDS different ones."""
        self.names: dict[str, str] = {}
        """Common name by session, of those connected now or before; Zenoh's log does not name a stranger."""
        self._gone: dict[str, None] = {}
        """Those of them that are not connected any more, in the order in which they went."""
        self._pending: dict[str, Refusal] = {}
        self._throttle = LogThrottle(to_ns(REPEAT_S))

    def feed(self, line: str, now_ns: int) -> str | None:
        """Take one line without colours; words for a person's log, at most every REPEAT_S for each kind."""
        refusal = self._read(line)
        if refusal is None:
            return None
        if refusal not in self.counts and len(self.counts) >= MAX_KINDS:
            self.more += 1
            return None
        self.counts[refusal] += 1
        passes = self._throttle.passes(now_ns, refusal)
        return f"{refusal} ({self.counts[refusal]} so far)" if passes else None

    def _read(self, line: str) -> Refusal | None:
        for pattern in _HANDSHAKE:
            if found := pattern.search(line):
                return Refusal("", _NUMBERS.sub("", found["why"]), "")
        thread = _THREAD.search(line)
        if thread is None:
            return None
        if _DROPPED in line:
            return self._pending.pop(thread[0], None)
        if named := _NAMED.search(line):
            self.learn(named["zid"], named["name"])
        self._pending.pop(thread[0], None)
        if found := _UNAUTHORIZED.search(line):
            name = self.names.get(found["zid"], found["zid"])
            self._pending[thread[0]] = Refusal(name, found["what"], found["key"])
        return None

    def learn(self, session: str, name: str) -> None:
        """Whose session this is. Too many are forgotten, first of all those that went first."""
        self._gone.pop(session, None)
        if session not in self.names and len(self.names) >= MAX_KINDS:
            forgotten = next(iter(self._gone), None) or next(iter(self.names))
            self._gone.pop(forgotten, None)
            self.names.pop(forgotten, None)
        self.names[session] = name

    def went(self, session: str) -> None:
        """The session disconnected; its refusals keep its name."""
        if session in self.names:
            self._gone[session] = None

    def metrics(self) -> RefusalMetrics:
        """For reports: handshakes by reason, messages by certificate, kind and key, and how many in all."""
        handshakes = {r.what: n for r, n in list(self.counts.items()) if not r.name}
        messages: dict[str, dict[str, int]] = {}
        for refusal, count in list(self.counts.items()):
            if refusal.name:
                kinds = messages.setdefault(self.names.get(refusal.name, refusal.name), {})
                kind = f"{refusal.what} {refusal.key}"
                kinds[kind] = kinds.get(kind, 0) + count
        total = self.counts.total() + self.more
        return RefusalMetrics(total, handshakes, messages)
