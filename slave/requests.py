"""Answers the requests of people and masters: bytes in, bytes out. Pure.

A stop comes before all else: whatever its version, whoever sends it, and whatever else is wrong with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from common.clock_sync import SlaveExchange
from common.errors import CodecError
from common.link.namesakes import Namesakes
from common.log.throttle import LogThrottle
from common.wire.codec import decode, encode
from common.wire.control import OPEN
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.stop import StopAnswer, pack_stop_answer, read_stop
from slave.guard import Guard
from slave.guard.control import Control, not_on_own_key
from slave.traffic import CommandTraffic


class UnreadMessages:
    """Counts messages that cannot be read, by topic."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self.counts: dict[str, int] = {}
        self.warn: Callable[[str], None] = lambda _: None
        """Called with a warning about one, at most once a second."""
        self._throttle = LogThrottle()

    def count(self, topic: str, error: CodecError, now_ns: int) -> None:
        """One more."""
        count = self.counts[topic] = self.counts.get(topic, 0) + 1
        if self._throttle.passes(now_ns):
            self.warn(f"{self._robot}: a {topic} message cannot be read: {error} ({count} so far)")


class Requests:
    """Decodes a request, has it decided (`guard/control.py`), and tells who counts commands and clocks."""

    def __init__(
        self,
        instance: int,
        place: str,
        control: Control,
        clock: SlaveExchange,
        *,
        traffic: CommandTraffic,
        namesakes: Namesakes,
        unread: UnreadMessages,
    ) -> None:
        """`instance`, `place`: which process answers, and where it is."""
        self._instance = instance
        self._place = place
        self._control = control
        self._clock = clock
        self._traffic = traffic
        self._namesakes = namesakes
        self._unread = unread

    def answer_operator(self, guard: Guard, payload: bytes, now_ns: int, sender: str | None) -> bytes:
        """Answer a request that came on the key of an operator, or (None) on one of none."""
        return self.answer(
            guard, payload, now_ns, frozenset(Action), lambda named: not_on_own_key(named, sender)
        )

    def answer(
        self,
        guard: Guard,
        payload: bytes,
        now_ns: int,
        allowed: frozenset[Action] = OPEN,
        foreign: Callable[[str], str | None] = lambda _: None,
    ) -> bytes:
        """Answer a request; by default one of anybody's.

        `foreign`: why the operator that a request names is not the one that sent it.
        """
        by = read_stop(payload)
        if by is not None:
            # answered in the form that every version reads
            reply = self._control.answer(guard, ControlRequest(guard.robot, Action.ESTOP, by), now_ns)
            return pack_stop_answer(StopAnswer(reply.done, reply.guard, reply.text, self._instance))
        try:
            request = decode(payload, ControlRequest)
        except CodecError as error:
            self._unread.count("control", error, now_ns)
            return self._packed(ControlReply(False, guard.state, f"not understood: {error}"))
        if request.action not in allowed:
            text = f"{request.action} is for operators only: send it on the control topic"
            return self._packed(ControlReply(False, guard.state, text))
        why = foreign(request.operator)
        if why is not None:
            guard.counters.foreign_requests += 1
            return self._packed(ControlReply(False, guard.state, why))
        reply = self._control.answer(guard, request, now_ns)
        if reply.done:
            self._tell(request, now_ns)
        return self._packed(reply)

    def _tell(self, done: ControlRequest, now_ns: int) -> None:
        match done.action:
            case Action.NAMESAKE:
                self._namesakes.on_notice(done.key, now_ns)
            case Action.CLAIM:
                self._clock.follow(done.clock)
                self._traffic.claimed(done.clock)
            case Action.RELEASE:
                self._traffic.released()

    def _packed(self, reply: ControlReply) -> bytes:
        return encode(replace(reply, instance=self._instance, place=self._place))
