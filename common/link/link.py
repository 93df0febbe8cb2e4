"""The topics of one robot over a session: publish, subscribe, answer, ask, be alive."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.link.declared import Declarations, Declare
from common.link.inbox import Inbox, OrderedInbox
from common.link.presence import watch_presence
from common.link.queries import Answered, Answerer, Asking
from common.link.waiting import count_peers, is_matching, paths_in_words, wait_for_peer
from common.log.throttle import LogThrottle
from common.metrics.link import TopicCounters
from common.wire.presence import ProcessPresence, present
from common.wire.topics import ALIVE, Topic

CONNECT_TIMEOUT_S = 3.0

Overheard = Callable[[str, bytes, int], None]
"""Takes the key, the bytes and the time, on this host's monotonic clock, of a message sent or received."""

log = logging.getLogger(__name__)


class Link:
    """The topics of one robot over one Zenoh session. All methods are for the loop's own thread.

    A link never receives what its own session publishes. Nothing is kept for
    a late subscriber.
    """

    def __init__(
        self,
        declared: Declarations,
        robot: str,
        loop: asyncio.AbstractEventLoop,
        quality: Callable[[Topic], Topic] = lambda topic: topic,
        overheard: Overheard | None = None,
    ) -> None:
        """`declared`: the session and what it holds. `quality`: the topic as it shall travel on this link.

        `overheard` is told of each message on topics, on the loop: those put, and those handed over.
        """
        self._overheard = overheard
        self.robot = robot
        self._quality = quality
        self._declared = declared
        self._loop = loop
        self._counters: dict[str, TopicCounters] = {}
        self._receivers: list[Inbox | Answerer] = []
        self._roles: set[str] = set()
        self._declarations: list[int] = []
        self._closed = False

    def publish(
        self, topic: Topic, on_wanted: Callable[[bool], None] | None = None
    ) -> Callable[[bytes], None]:
        """A function that puts a payload on the topic. It never blocks and never raises: failures count.

        `on_wanted(wanted)` is told, in Zenoh's thread, when the first subscriber appears and the last one
        goes: what nobody hears need not be made.
        """
        if not topic.drop:
            raise ValueError(f"{topic.name} would block under congestion, and stall the loop")
        topic = self._quality(topic)
        counters = self._count(topic)
        throttle = LogThrottle()
        key, overheard = self._own_key(topic), self._overheard
        put: Callable[[bytes], None]

        def declare(session: zenoh.Session) -> object:
            nonlocal put
            publisher = session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=getattr(zenoh.Priority, topic.priority.name),
                express=topic.express,
                reliability=zenoh.Reliability.RELIABLE if topic.reliable else zenoh.Reliability.BEST_EFFORT,
                allowed_destination=zenoh.Locality.REMOTE,
            )
            put = publisher.put
            if on_wanted is None:
                return publisher
            on_wanted(is_matching(publisher.matching_status))
            on_this = self._declared.only_of(session, lambda status: on_wanted(is_matching(status)))
            changed: Callback[zenoh.MatchingStatus] = Callback(on_this, indirect=False)
            listener = publisher.declare_matching_listener(changed)
            return [listener, publisher]

        def publish(payload: bytes) -> None:
            try:
                put(payload)
            except Exception as error:  # Zenoh's errors share no base that promises to be the only one
                counters.put_errors += 1
                if throttle.passes(monotonic_ns()):
                    log.warning("%s: message not sent: %s", topic.name, error)
            else:
                counters.sent += 1
                if overheard is not None:
                    overheard(key, payload, monotonic_ns())

        self._declare(declare)
        return publish

    def subscribe(self, topic: Topic, on_payload: Callable[[bytes, int], None], in_order: int = 0) -> None:
        """Call `on_payload(payload, arrived_ns)` on the loop with the newest payload of other sessions.

        `arrived_ns` is stamped in Zenoh's thread, before the loop is woken.
        """
        self.subscribe_keys(topic, lambda _, payload, arrived_ns: on_payload(payload, arrived_ns), in_order)

    def subscribe_keys(
        self, topic: Topic, on_payload: Callable[[str, bytes, int], None], in_order: int = 0
    ) -> None:
        """As `subscribe`, with the key on which each payload came: the newest of each key is handed over.

        `in_order`: not the newest alone, but all, up to so many that wait; for voice and video.
        """
        key, overheard = topic.key_for(self.robot), self._overheard

        def overhear(own_key: str, payload: bytes, arrived_ns: int) -> None:
            on_payload(own_key, payload, arrived_ns)
            if overheard is not None:
                overheard(own_key, payload, arrived_ns)

        taken = on_payload if overheard is None else overhear
        counters = self._count(topic)
        inbox = (
            OrderedInbox(key, taken, self._loop, counters, in_order)
            if in_order
            else Inbox(key, taken, self._loop, counters)
        )
        self._receivers.append(inbox)

        def declare(session: zenoh.Session) -> object:
            on_this = self._declared.only_of(session, inbox.on_sample)
            return session.declare_subscriber(key, Callback(on_this, indirect=False))

        self._declare(declare)

    def answer(self, topic: Topic, handler: Callable[[bytes, int], bytes]) -> None:
        """Answer other sessions' questions with `handler(payload, arrived_ns)`, run on the loop.

        An exception in the handler is counted, logged, and sent to the asker as an error's text.
        """
        self.answer_keys(topic, lambda _, payload, arrived_ns: handler(payload, arrived_ns))

    def answer_keys(self, topic: Topic, handler: Callable[[str, bytes, int], bytes]) -> None:
        """As `answer`, with the key on which each question came."""
        key = topic.key_for(self.robot)
        answerer = Answerer(key, handler, self._loop, self._count(topic), self._quality(topic).express)
        self._receivers.append(answerer)

        def declare(session: zenoh.Session) -> object:
            on_this = self._declared.only_of(session, answerer.on_query, answerer.on_query_of_old)
            return session.declare_queryable(key, Callback(on_this, indirect=False), complete=True)

        self._declare(declare)

    async def connected(self, topic: Topic | None = None, timeout_s: float = CONNECT_TIMEOUT_S) -> None:
        """Wait for another session, and where a topic is given, for one that answers its questions.

        Raises LinkTimeoutError when none comes.
        """
        key = None if topic is None else self._own_key(topic)
        await wait_for_peer(self._declared.session, key, timeout_s)

    async def ask(self, topic: Topic, payload: bytes) -> bytes:
        """The answer. LinkTimeoutError after the topic's time-out; LinkError if no session answers it."""
        return (await self.ask_stamped(topic, payload))[0]

    async def ask_stamped(self, topic: Topic, payload: bytes) -> tuple[bytes, int]:
        """As `ask`, with the answer's arrival in ns, stamped in Zenoh's thread."""
        topic = self._quality(topic)
        asking = Asking(self._declared.session, topic, self._own_key(topic), self._count(topic))
        return await asking.first(payload)

    async def ask_all(
        self, topic: Topic, payload: bytes, on_answer: Callable[[Answered], None] = lambda _: None
    ) -> list[Answered]:
        """The answers of every session that answers the topic; `on_answer` takes each as it comes.

        It lasts until each has answered, or for the topic's time-out. Raises as `ask` if none answered.
        """
        topic = self._quality(topic)
        asking = Asking(self._declared.session, topic, self._own_key(topic), self._count(topic))
        return await asking.all(payload, on_answer)

    def declare_alive(
        self, role: str, instance: int = 0, endpoints: Sequence[str] = (), profile: str = ""
    ) -> None:
        """Show other sessions that this role lives, until the session closes or dies.

        With an instance number also which process it is, of which version, where, and a robot's profile.
        """
        self._roles.add(role)
        keys = [self._alive_key(role)]
        if instance:
            keys.append(present(self.robot, role, instance, endpoints, profile).key)
        self._declare(lambda s: [s.liveliness().declare_token(key) for key in keys])

    def watch_presence(self, on_change: Callable[[ProcessPresence, bool], None]) -> None:
        """Call `on_change(presence, alive)` on the loop as processes of this robot's name come and go.

        Those already alive are reported at once, this session's own among them.
        """
        self._declarations.append(watch_presence(self._declared, self._loop, self.robot, on_change))

    def counters(self) -> dict[str, TopicCounters]:
        """A copy of the counters, by topic name."""
        return {name: replace(counters) for name, counters in self._counters.items()}

    @property
    def paths(self) -> str:
        """Of two paths, which one does not carry and why; empty where both do, or where there is one."""
        return "" if self._closed else paths_in_words(self._declared.session)

    @property
    def peers(self) -> int:
        """How many sessions this one is connected to now."""
        return 0 if self._closed else count_peers(self._declared.session)

    def close(self) -> None:
        """Hear and answer nothing from now on. The session stays open for the other robots' links."""
        self._closed = True
        for receiver in self._receivers:
            receiver.close()

    def withdraw(self) -> None:
        """Close the link for good while the session goes on: nothing of this robot crosses the line then."""
        self.close()
        for number in reversed(self._declarations):
            self._declared.remove(number)
        self._declarations.clear()

    def _declare(self, declare: Declare) -> None:
        self._declarations.append(self._declared.add(declare))

    def _own_key(self, topic: Topic) -> str:
        """The key on which this session sends. Raises ValueError for a topic that lacks the operator."""
        key = topic.key_for(self.robot)
        if "*" in key:
            raise ValueError(f"{topic.name}: whose key? Send on {topic.name.upper()}.of(operator)")
        return key

    def _alive_key(self, role: str) -> str:
        return f"{ALIVE.key_for(self.robot)}/{role}"

    def _count(self, topic: Topic) -> TopicCounters:
        return self._counters.setdefault(topic.name, TopicCounters())
