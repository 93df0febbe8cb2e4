"""Questions that must be answered: the side that answers, and the side that asks."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.errors import CodecError, LinkError, LinkTimeoutError
from common.link.inbox import wake
from common.log.throttle import LogThrottle
from common.metrics.link import TopicCounters
from common.wire.stop import read_stop
from common.wire.topics import Topic

MAX_WAITING = 64
"""Questions that may wait for the loop; more are turned away, so that a flood costs no memory.

A stop is not turned away for a flood of other questions: as many again may wait."""
_TIMED_OUT = "Timeout"
"""What Zenoh itself answers when the time is up."""

log = logging.getLogger(__name__)


class Answerer:
    """Answers a key's questions with `handler(key, payload, arrived_ns) -> reply`, on the loop, in order."""

    def __init__(
        self,
        key: str,
        handler: Callable[[str, bytes, int], bytes],
        loop: asyncio.AbstractEventLoop,
        counters: TopicCounters,
        express: bool = True,
    ) -> None:
        self._express = express
        self._key = key
        self._handler = handler
        self._loop = loop
        self._counters = counters
        self._throttle = LogThrottle()
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
        payload = b"" if query.payload is None else query.payload.to_bytes()
        waiting = self._arrived - self._done
        if waiting >= MAX_WAITING and not (waiting < 2 * MAX_WAITING and read_stop(payload) is not None):
            self._counters.refused += 1
            with query:
                query.reply_err("busy")
            return
        self._arrived += 1
        wake(self._loop, self._answer, query, payload, arrived_ns)

    def on_query_of_old(self, query: zenoh.Query) -> None:
        """From a session that another has replaced, in Zenoh's thread: it may do nothing but stop."""
        if query.payload is not None and read_stop(query.payload.to_bytes()) is not None:
            self.on_query(query)
        else:
            query.drop()

    def close(self) -> None:
        """Answer nothing from now on."""
        self._closed = True

    def _answer(self, query: zenoh.Query, payload: bytes, arrived_ns: int) -> None:
        self._done += 1
        try:
            with query:
                if not self._closed:
                    self._reply(query, payload, arrived_ns)
        except Exception as error:  # the asker has gone, or the session closes
            log.debug("no answer on %s: %s", self._key, error)

    def _reply(self, query: zenoh.Query, payload: bytes, arrived_ns: int) -> None:
        key = str(query.key_expr)
        try:
            reply = self._handler(key, payload, arrived_ns)
        except CodecError as error:
            self._counters.handler_errors += 1
            if self._throttle.passes(monotonic_ns()):
                log.warning("%s: received a query that cannot be decoded: %s", self._key, error)
            query.reply_err(str(error))
            return
        except Exception as error:
            self._counters.handler_errors += 1
            if self._throttle.passes(monotonic_ns()):
                log.exception("%s: the handler failed", self._key)
            query.reply_err(f"{type(error).__name__}: {error}")
            return
        query.reply(key, reply, express=self._express)
        self._counters.answered += 1


@dataclass(frozen=True, slots=True)
class Answered:
    """One answer to a question."""

    payload: bytes
    arrived_ns: int
    """This host's clock."""
    replier: str = ""
    """The session that answered; empty where Zenoh does not name it."""


class Asking:
    """Asks the sessions that answer a key: `first` takes the nearest one's answer, `all` every answer."""

    def __init__(self, session: zenoh.Session, topic: Topic, key: str, counters: TopicCounters) -> None:
        self._session = session
        self._topic = topic
        self._key = key
        self._counters = counters

    async def first(self, payload: bytes) -> tuple[bytes, int]:
        """The first answer and when it arrived, ns of this host's clock.

        Raises LinkTimeoutError after the topic's time-out, LinkError at once if no session answers the key.
        """
        question = Question(asyncio.get_running_loop(), enough=1)
        answers = await self._ask(question, zenoh.QueryTarget.BEST_MATCHING, payload)
        return answers[0].payload, answers[0].arrived_ns

    async def all(self, payload: bytes, on_answer: Callable[[Answered], None]) -> list[Answered]:
        """Every answer, through peers and routers, until each session has answered or the time-out is over.

        Raises as `first` if none answered.
        """
        question = Question(asyncio.get_running_loop(), on_answer=on_answer)
        return await self._ask(question, zenoh.QueryTarget.ALL, payload)

    async def _ask(self, question: Question, target: zenoh.QueryTarget, payload: bytes) -> list[Answered]:
        topic, counters = self._topic, self._counters
        counters.asked += 1
        try:
            self._send(question, target, payload)
            # Zenoh's own time-out comes first; this one is for a Zenoh that does not keep it
            async with asyncio.timeout(topic.timeout_s + 0.1):
                await question.over
        except TimeoutError:
            question.fail(LinkTimeoutError("no answer in time"))
        except zenoh.ZError as error:
            question.fail(LinkError(str(error)))
        if question.answers:
            return question.answers
        if isinstance(question.failure, LinkTimeoutError):
            counters.timeouts += 1
            raise LinkTimeoutError(f"{self._key}: no answer within {topic.timeout_s:g} s") from None
        counters.unanswered += 1
        raise LinkError(f"{self._key}: {question.failure or 'no process answers there'}") from None

    def _send(self, question: Question, target: zenoh.QueryTarget, payload: bytes) -> None:
        topic = self._topic
        self._session.get(
            self._key,
            Callback(question.on_reply, question.on_end, indirect=False),
            payload=payload,
            timeout=topic.timeout_s,
            target=target,
            # else an answer is held back until every answerer has finished, and two may become one
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, topic.priority.name),
            express=topic.express,
            allowed_destination=zenoh.Locality.REMOTE,
        )


class Question:
    """One question on its way: `over` when enough answers came, or no more will."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        enough: int = 0,
        on_answer: Callable[[Answered], None] = lambda _: None,
    ) -> None:
        """`enough`: so many answers, or an error, end it; 0: only Zenoh's word that no more will come."""
        self._loop = loop
        self._enough = enough
        self._on_answer = on_answer
        self.over: asyncio.Future[None] = loop.create_future()
        self.answers: list[Answered] = []
        self.failure: LinkError | None = None

    def on_reply(self, reply: zenoh.Reply) -> None:
        """Called in Zenoh's thread."""
        arrived_ns = monotonic_ns()
        if reply.ok is not None:
            replier = "" if reply.replier_id is None else str(reply.replier_id.zid)
            wake(self._loop, self._take, Answered(reply.ok.payload.to_bytes(), arrived_ns, replier))
            return
        text = reply.err.payload.to_bytes().decode("utf-8", "replace") if reply.err is not None else ""
        error = LinkTimeoutError("no answer in time") if text == _TIMED_OUT else LinkError(f"refused: {text}")
        wake(self._loop, self.fail, error)

    def on_end(self) -> None:
        """Called in Zenoh's thread: no more will come."""
        wake(self._loop, self._end)

    def fail(self, error: LinkError) -> None:
        """Note that a session did not answer."""
        self.failure = self.failure or error
        if self._enough:
            self._end()

    def _take(self, answer: Answered) -> None:
        if self.over.done():
            return
        self.answers.append(answer)
        self._on_answer(answer)
        if self._enough and len(self.answers) >= self._enough:
            self._end()

    def _end(self) -> None:
        if not self.over.done():
            self.over.set_result(None)
