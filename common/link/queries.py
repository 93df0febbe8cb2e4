"""Questions that must be answered: the side that answers, and the side that asks."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.errors import LinkError, LinkTimeoutError
from common.link.counters import TopicCounters
from common.link.inbox import wake
from common.throttle import Throttle
from common.topics import Topic

MAX_WAITING = 64
"""Questions that may wait for the loop; more are turned away, so that a flood costs no memory."""
_TIMED_OUT = "Timeout"
"""What Zenoh itself answers when the time is up."""

log = logging.getLogger(__name__)


class Answerer:
    """Answers a key's questions with `handler(payload, arrived_ns) -> reply`, run on the loop in order."""

    def __init__(
        self,
        key: str,
        handler: Callable[[bytes, int], bytes],
        loop: asyncio.AbstractEventLoop,
        counters: TopicCounters,
        express: bool = True,
    ) -> None:
        self._express = express
        self._key = key
        self._handler = handler
        self._loop = loop
        self._counters = counters
        self._throttle = Throttle()
        self._arrived = 0
        self._done = 0
        self._closed = False

    def on_query(self, query: zenoh.Query) -> None:
        """Called in Zenoh's thread: stamp, copy, hand over, nothing else."""
        arrived_ns = monotonic_ns()
        if self._closed:
            query.drop()
            return
        self._counters.received += 1
        # each of the two counts has one writer, so their difference needs no lock
        if self._arrived - self._done >= MAX_WAITING:
            self._counters.refused += 1
            with query:
                query.reply_err("busy")
            return
        self._arrived += 1
        payload = query.payload
        wake(self._loop, self._answer, query, b"" if payload is None else payload.to_bytes(), arrived_ns)

    def close(self) -> None:
        """Answer nothing from now on."""
        self._closed = True

    def _answer(self, query: zenoh.Query, payload: bytes, arrived_ns: int) -> None:
        self._done += 1
        try:
            with query:
                if not self._closed:
                    self._reply(query, payload, arrived_ns)
        except Exception as error:  # the asker has gone, or the session closes: nothing to be done for it
            log.debug("no answer on %s: %s", self._key, error)

    def _reply(self, query: zenoh.Query, payload: bytes, arrived_ns: int) -> None:
        try:
            reply = self._handler(payload, arrived_ns)
        except Exception as error:
            self._counters.handler_errors += 1
            if self._throttle.passes(monotonic_ns()):
                log.exception("handler of %s failed", self._key)
            query.reply_err(f"{type(error).__name__}: {error}")
            return
        query.reply(self._key, reply, express=self._express)
        self._counters.answered += 1


class Question:
    """One question on its way: the first answer, or what came instead, decides."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self.answer: asyncio.Future[tuple[bytes, int]] = loop.create_future()

    def send(self, session: zenoh.Session, topic: Topic, key: str, payload: bytes) -> None:
        """Ask every remote answerer of the key. Raises ZError where the session is closed."""
        session.get(
            key,
            Callback(self._on_reply, self._on_end, indirect=False),
            payload=payload,
            timeout=topic.timeout_s,
            target=zenoh.QueryTarget.BEST_MATCHING,
            # else an answer is held back until every answerer has finished
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, topic.priority.name),
            express=topic.express,
            allowed_destination=zenoh.Locality.REMOTE,
        )

    def _on_reply(self, reply: zenoh.Reply) -> None:
        arrived_ns = monotonic_ns()
        if reply.ok is not None:
            wake(self._loop, self._settle, (reply.ok.payload.to_bytes(), arrived_ns), None)
            return
        text = reply.err.payload.to_bytes().decode("utf-8", "replace") if reply.err is not None else ""
        error = LinkTimeoutError("no answer in time") if text == _TIMED_OUT else LinkError(f"refused: {text}")
        wake(self._loop, self._settle, None, error)

    def _on_end(self) -> None:
        wake(self._loop, self._settle, None, LinkError("nobody is there to answer"))

    def _settle(self, answer: tuple[bytes, int] | None, error: LinkError | None) -> None:
        if self.answer.done():
            return
        if answer is not None:
            self.answer.set_result(answer)
        elif error is not None:
            self.answer.set_exception(error)


async def ask(
    session: zenoh.Session, topic: Topic, key: str, payload: bytes, counters: TopicCounters
) -> tuple[bytes, int]:
    """The first answer and when it arrived, ns of this host's clock.

    Raises LinkTimeoutError after the topic's time-out, LinkError at once where nobody can answer.
    """
    counters.asked += 1
    question = Question(asyncio.get_running_loop())
    try:
        question.send(session, topic, key, payload)
        # Zenoh's own time-out comes first; this one is for a Zenoh that does not keep it
        async with asyncio.timeout(topic.timeout_s + 0.1):
            return await question.answer
    except TimeoutError:  # LinkTimeoutError is one too
        counters.timeouts += 1
        raise LinkTimeoutError(f"{key}: no answer within {topic.timeout_s:g} s") from None
    except (LinkError, zenoh.ZError) as error:
        counters.unanswered += 1
        raise LinkError(f"{key}: {error}") from None
