"""Observes a run: receives commands, states, truth and statistics, and changes nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from common.clock import to_ns, to_s
from common.errors import CodecError
from common.latency.one_way import master_offset
from common.link import Link
from common.metrics.master import MasterMetrics
from common.metrics.slave import CameraMetrics, SlaveMetrics
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState, Statistics, Truth
from common.wire.topics import COMMAND, STATE, STATISTICS, TOPICS, TRUTH, Topic
from deploy.harness.operator import GuardSight
from deploy.measure import Trace

Heard = Command | RobotState | Statistics | Truth
KINDS: dict[str, type[Heard]] = {
    COMMAND.name: Command,
    STATE.name: RobotState,
    TRUTH.name: Truth,
    STATISTICS.name: Statistics,
}
"""What an observer hears, by the topic's name."""

RATE_OVER_NS = 900_000_000
"""A rate is taken over at least this long: statistics come once a second, give or take a late tick."""


class Observer:
    """Keeps the newest of each message and, while recording, everything that a report needs."""

    def __init__(self, link: Link, skeleton: Skeleton) -> None:
        self._joints = len(skeleton.joints)
        self.trace = Trace(skeleton.joint_names)
        self.recording = False
        self.command: Command | None = None
        self.state: RobotState | None = None
        self.truth: Truth | None = None
        self.master: MasterMetrics | None = None
        self.slave: SlaveMetrics | None = None
        self.undecodable = 0
        """Messages that could not be read: of another version, or broken."""
        self.guard_changes: list[GuardSight] = []
        """The first state of each stretch in one guard state."""
        self.states: list[RobotState] = []
        """While recording."""
        self.commands: list[Command] = []
        """While recording."""
        self.video: CameraMetrics | None = None
        """What the robot last published of its camera while recording; None where it has none."""
        self.listeners: list[Callable[[Heard], None]] = []
        """Each is called with every message, whether recording or not."""
        self.tapes: list[Callable[[Topic, bytes, int], None]] = []
        """Each is called with every readable message as it came: topic, bytes, time of arrival (ns)."""
        self._known_from = -1
        """Number of the command since which every joint was known; -1: one is not."""
        self._news = asyncio.Event()
        self._marks: dict[str, tuple[int, int]] = {}
        self.rates_hz: dict[str, float] = {}
        """From the senders' numbers and clocks: this side receives only the newest of several that wait."""
        for topic, kind in KINDS.items():
            link.subscribe(TOPICS[topic], partial(self._take, TOPICS[topic], kind))

    def _take(self, topic: Topic, kind: type[Heard], payload: bytes, arrived_ns: int) -> None:
        try:
            message = decode(payload, kind, self._joints)
        except CodecError:
            self.undecodable += 1
            return
        for tape in self.tapes:
            tape(topic, payload, arrived_ns)
        for listener in self.listeners:
            listener(message)
        if isinstance(message, Statistics):
            self._take_metrics(message)
            return
        if isinstance(message, Command):
            self.command = message
            if not message.valid.all():
                self._known_from = -1
            elif self._known_from < 0 or message.sequence < self._known_from:
                self._known_from = message.sequence
            self._rate("commands", message.sequence, message.stamps.put_ns)
        elif isinstance(message, RobotState):
            self.state = message
            self._rate("states", message.sequence, message.sent_ns)
            if not self.guard_changes or self.guard_changes[-1].guard != message.guard:
                self.guard_changes.append(GuardSight(message.sent_ns, message.guard, message.reason))
        else:
            self.truth = message
        if self.recording:
            self.trace.add(message)
            if isinstance(message, RobotState):
                self.states.append(message)
            elif isinstance(message, Command):
                self.commands.append(message)
        self._news.set()

    def _take_metrics(self, message: Statistics) -> None:
        if isinstance(message.metrics, MasterMetrics):
            self.master, ticks = message.metrics, message.metrics.ticks
            self._rate("capture", ticks.expected - ticks.missed, message.sent_ns)
        else:
            self.slave = message.metrics
            if self.recording:
                self.video = self.slave.video

    def _rate(self, name: str, count: int, at_ns: int) -> None:
        before, since_ns = self._marks.get(name, (0, 0))
        if not since_ns or count < before:  # the first, or the sender has started again
            self._marks[name] = (count, at_ns)
        elif at_ns - since_ns >= RATE_OVER_NS:
            self.rates_hz[name] = (count - before) / to_s(at_ns - since_ns)
            self._marks[name] = (count, at_ns)

    async def news(self) -> None:
        """Wait for the next message."""
        self._news.clear()
        await self._news.wait()

    @property
    def guard(self) -> str:
        """The guard's newest state."""
        return self.state.guard if self.state else "not heard"

    @property
    def guards_seen(self) -> list[str]:
        """The guard's states, in the order in which they came."""
        return [sight.guard for sight in self.guard_changes]

    @property
    def sent_ns(self) -> int:
        """When the newest state was sent, robot's clock; 0 before any."""
        return self.state.sent_ns if self.state else 0

    @property
    def ready(self) -> bool:
        """Whether engaging makes sense: every joint known, and the robot takes the master's commands."""
        command, state = self.command, self.state
        if command is None or state is None or state.echo is None or state.guard != "hold":
            return False
        taken_ns = state.sent_ns - state.echo.received_ns
        # this observer may be nearer to the master than the robot is
        known = 0 <= self._known_from <= state.echo.sequence
        return known and taken_ns < to_ns(2.0 / COMMAND.rate_hz)

    def waiting_for(self) -> str:
        """What is missing until `ready`, for a person."""
        command, state = self.command, self.state
        if state is None:
            return "the robot is not heard"
        if command is None:
            return f"the master sends no commands; the robot is in {state.guard}: {state.reason}"
        if not command.valid.all():
            names = [n for n, ok in zip(self.trace.joint_names, command.valid, strict=True) if not ok]
            return f"{len(names)} joints are not known yet ({', '.join(names[:3])} …)"
        if command.lease == 0:
            return "the master does not hold the robot's lease"
        if not master_offset(state).trusted:
            return "the clock offset is not trusted yet"
        if not self.ready and state.guard == "hold":
            return "the robot takes no command yet"
        return f"the guard is in {state.guard}: {state.reason}"
