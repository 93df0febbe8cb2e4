"""Two Zenoh sessions over two paths that stand as one: everything is sent on both, what comes first counts.

Each message carries a number of its sender in the attachment. The receiver takes a number once; what is not
newer is a duplicate, or late, and is dropped and counted. Where all are taken in turn (voice, video), one
that was overtaken may still fill a gap. A question goes out on both paths under one number too: it is handled
once, and its answer goes back on both. So a path that is cut costs nothing, not even the time to notice.

Zenoh's own `max_links` was not taken: it sends each message on one of the links.
"""

from __future__ import annotations

import secrets
import struct
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Protocol, TypeVar

import zenoh
from zenoh.handlers import Callback

Part = TypeVar("Part", covariant=True)
NUMBER = struct.Struct("<QQ")
"""Sender and number."""
MOST_SENDERS = 256
"""Of whom the newest number is remembered."""
MOST_QUESTIONS = 256


class FirstArrivals:
    """Which messages of numbered senders are new. Thread-safe: two sessions call it."""

    def __init__(self, behind: int = 0) -> None:
        """`behind`: by how much a number that did not come yet may be overtaken; 0: only newer ones count."""
        self._behind = behind
        self._newest: OrderedDict[tuple[str, int], tuple[int, frozenset[int]]] = OrderedDict()
        """By key and sender: the newest number, and which of those `behind` it came."""
        self._lock = threading.Lock()
        self.dropped = 0
        """Second copies, and messages that a newer one overtook."""

    def is_first(self, key: str, attachment: bytes | None) -> bool:
        """Whether to take it. A message without a number, of a sender with one path, always is."""
        if attachment is None or len(attachment) != NUMBER.size:
            return True
        sender, number = NUMBER.unpack(attachment)
        with self._lock:
            newest, came = self._newest.pop((key, sender), (-1, frozenset()))
            first = bool(number > newest or (number > newest - self._behind and number not in came))
            newest = max(newest, number)
            if self._behind:
                came = frozenset(each for each in (*came, number) if each > newest - self._behind)
            self._newest[key, sender] = newest, came
            while len(self._newest) > MOST_SENDERS:
                self._newest.popitem(last=False)
            self.dropped += not first
            return first


class Held(Protocol[Part]):
    """Something that is declared on every path that is open (`twin_session.OnPaths`)."""

    @property
    def each(self) -> tuple[Part, ...]:
        """What holds it on each path."""

    def on(self, path: int) -> Part:
        """What holds it on that path."""

    def undeclare(self) -> None:
        """On every path."""


class TwinPublisher:
    """Puts each payload on every path that is open."""

    def __init__(
        self,
        publishers: Held[zenoh.Publisher],
        declare: Callable[[Callable[[int, zenoh.Session], object]], Held[object]],
    ) -> None:
        """`declare`: of the session, for what listens to this publisher."""
        self._publishers = publishers
        self._declare = declare
        self._sender, self._number = secrets.randbits(64), 0

    def put(self, payload: bytes) -> None:
        """Put it; raises what the last path raised where none took it."""
        self._number += 1
        attachment, failed = NUMBER.pack(self._sender, self._number), []
        publishers = self._publishers.each
        for publisher in publishers:
            try:
                publisher.put(payload, attachment=attachment)
            except zenoh.ZError as error:
                failed.append(error)
        if len(failed) == len(publishers):
            raise failed[-1]

    @property
    def matching_status(self) -> bool:
        """Whether anybody subscribes, on any path."""
        statuses = (publisher.matching_status for publisher in self._publishers.each)
        return any(bool(getattr(status, "matching", status)) for status in statuses)

    def declare_matching_listener(self, changed: Callback[zenoh.MatchingStatus]) -> Held[object]:
        """Tell when that changes: `changed` gets this publisher, which knows all paths."""
        callback: Callable[..., object] = changed.callback
        both: Callback[zenoh.MatchingStatus] = Callback(lambda _: callback(self), indirect=False)
        return self._declare(lambda path, _: self._publishers.on(path).declare_matching_listener(both))

    @property
    def matching(self) -> bool:
        """As a status has it."""
        return self.matching_status

    def undeclare(self) -> None:
        """On every path."""
        self._publishers.undeclare()


class TwinQuery:
    """One question that comes twice: handled once, answered on every path on which it came."""

    def __init__(self, first: zenoh.Query) -> None:
        self._copies = [first]
        self._answer: Callable[[zenoh.Query], None] | None = None
        self._dropped = False
        self._lock = threading.Lock()
        self.payload, self.key_expr = first.payload, first.key_expr

    def __enter__(self) -> TwinQuery:
        return self

    def __exit__(self, *_: object) -> None:
        self.drop()

    def also(self, query: zenoh.Query) -> None:
        """Another copy came: it waits for the answer, or gets it."""
        with self._lock:
            answer = self._answer
            if answer is None and not self._dropped:
                self._copies.append(query)
                return
        with query:
            if answer is not None:
                answer(query)

    def reply(self, key: str, payload: bytes, *, express: bool) -> None:
        """Answer every copy, also one that is still to come."""
        self._give(lambda query: query.reply(key, payload, express=express))

    def reply_err(self, words: str) -> None:
        """Refuse every copy."""
        self._give(lambda query: query.reply_err(words))

    def _give(self, answer: Callable[[zenoh.Query], None]) -> None:
        with self._lock:
            self._answer, copies = answer, tuple(self._copies)
        for query in copies:
            try:
                answer(query)
            except zenoh.ZError:  # that path is cut; the other copy was answered, or will be
                continue

    def drop(self) -> None:
        """No more answers: the askers need not wait."""
        with self._lock:
            copies, self._copies, self._dropped = tuple(self._copies), [], True
        for query in copies:
            query.drop()


class TwinQuestions:
    """Brings together the copies of each question: same number, same key, same bytes.

    The number alone would let anybody who saw one choose what the asker's next question counts as a copy of.
    """

    def __init__(self, handle: Callable[..., object]) -> None:
        self._handle = handle
        self._known: OrderedDict[tuple[bytes, str, bytes], TwinQuery] = OrderedDict()
        self._lock = threading.Lock()

    def on_query(self, query: zenoh.Query) -> None:
        """Called in Zenoh's threads."""
        number = None if query.attachment is None else query.attachment.to_bytes()
        if number is None or len(number) != NUMBER.size:
            self._handle(query)
            return
        payload = b"" if query.payload is None else query.payload.to_bytes()
        copy_of = number, str(query.key_expr), payload
        with self._lock:
            known = self._known.get(copy_of)
            if known is None:
                self._known[copy_of] = twin = TwinQuery(query)
            while len(self._known) > MOST_QUESTIONS:
                self._known.popitem(last=False)
        if known is not None:
            known.also(query)
        else:
            self._handle(twin)


class TwinAnswers:
    """The answers of all paths to one question, each once; the end when all have ended."""

    def __init__(
        self, on_reply: Callable[[zenoh.Reply], object], on_end: Callable[[], object], paths: int
    ) -> None:
        self._on_reply = on_reply
        self._on_end = on_end
        self._seen: set[bytes] = set()
        self._refused: list[zenoh.Reply] = []
        self._open = paths
        self._lock = threading.Lock()

    def reply(self, reply: zenoh.Reply) -> None:
        """Called in Zenoh's threads. A refusal counts only where no path brought an answer."""
        with self._lock:
            if reply.ok is None:
                self._refused.append(reply)
                return
            payload = reply.ok.payload.to_bytes()
            if payload in self._seen:
                return
            self._seen.add(payload)
        self._on_reply(reply)

    def end(self) -> None:
        """One path has ended."""
        with self._lock:
            self._open -= 1
            if self._open:
                return
            refused = [] if self._seen else self._refused[:1]
        for reply in refused:
            self._on_reply(reply)
        self._on_end()
