"""The robot's host in a trial on separate hosts: a fresh slave for each cell, and answers about it."""

from __future__ import annotations

import asyncio
import logging
import tempfile
from collections.abc import Awaitable
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path

from common.clock import monotonic_ns, to_ns
from common.config.load import load_config
from common.errors import CodecError, TandemError
from common.link import Link, open_link, open_session
from common.link.config import LinkConfig
from common.link.endpoint import TRANSPORTS
from common.process.runtime import until_stopped
from common.wire.codec import encode
from common.wire.control import ask_control
from common.wire.messages import Action, ControlRequest
from common.wire.topics import COMMAND, CONTROL
from deploy.experiments.trial.cell.choice import strategies
from deploy.experiments.trial.cell.recorder import MessageKeeper
from deploy.experiments.trial.cell.recording import CellMessages
from deploy.experiments.trial.remote import talk
from deploy.harness.child import Child
from deploy.harness.endpoints import free_port
from deploy.harness.observer import Observer
from slave.config import SlaveConfig

log = logging.getLogger(__name__)

UP_S = 20.0
"""A slave that publishes no state for this long after its start has failed."""
IDLE_S = 60.0
"""Without a request for this long the slave is stopped: the operator's host is gone."""
LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What the command line chose."""

    config: Path
    """The robot's own file."""
    listen: str
    """Endpoint at which this host waits for `tandem trial --remote`."""
    address: str = "0.0.0.0"
    """Where slaves listen."""
    port: int = 7447
    max_age_s: float = 1.0
    """The largest age limit of the guard that the operator's host may set."""


class RobotHost:
    """Answers the operator's host. One slave at a time."""

    def __init__(self, options: ServeOptions, folder: Path) -> None:
        self._options = options
        self._folder = folder
        self._config = load_config(options.config, SlaveConfig)
        if self._config.link.access is not None:
            # its rules know neither these requests nor transports without certificates
            raise TandemError(
                f"{options.config}: a trial cannot be served under [link.access]: use a copy of the file "
                "without it, on a network that you trust"
            )
        self._running: AsyncExitStack | None = None
        self._child: Child | None = None
        self._link: Link | None = None
        self._observer: Observer | None = None
        self._recorder = MessageKeeper()
        self._kept = CellMessages([], [], [], [])
        self._task: asyncio.Task[None] | None = None
        self._fault = ""
        self._asked_ns = monotonic_ns()
        self._started = 0

    async def run(self) -> None:
        """Serve until cancelled."""
        link_config = self._config.link.model_copy(
            update={"listen": [self._options.listen], "connect": [], "mode": "peer"}
        )
        try:
            async with open_link(link_config, self._config.robot) as link:
                link.answer(talk.TALK, self.on_request)
                log.info(
                    "%s: waiting for an operator's trial at %s", self._config.robot, self._options.listen
                )
                while True:
                    await asyncio.sleep(1.0)
                    if self._child is not None and monotonic_ns() - self._asked_ns > to_ns(IDLE_S):
                        log.warning("no request for %g s: the slave is stopped", IDLE_S)
                        await self._stop()
        finally:
            if self._task is not None:
                self._task.cancel()
            await self._stop()

    def on_request(self, payload: bytes, _: int) -> bytes:
        """The answer's bytes. It never waits."""
        self._asked_ns = monotonic_ns()
        try:
            request = talk.read_request(payload)
        except CodecError as error:
            return talk.pack(talk.TalkAnswer(taken=False, fault=f"not understood: {error}"))
        if isinstance(request, talk.Page):
            return talk.pack(self._page(request.first))
        refusal = self._begin_request(request)
        return talk.pack(self._situation(refusal))

    def _begin_request(self, request: talk.Request) -> str:
        """Begin what was requested; the reason where it is refused."""
        if isinstance(request, talk.Look):
            return ""
        if self._task is not None and not self._task.done():
            return "the last request is still being carried out"
        if isinstance(request, talk.Start):
            refusal = self._why_not(request)
            if not refusal:
                self._begin(self._start(request))
            return refusal
        if self._child is None:
            return "no slave is running"
        match request:
            case talk.Engage():
                self._begin(self._engage(request.operator))
            case talk.Record():
                self._child.measure(first=True)
                self._recorder.take()
            case talk.EndRecording():
                self._child.measure()
                self._kept = self._recorder.take()
            case talk.Stop():
                self._begin(self._stop())
        return ""

    def _why_not(self, start: talk.Start) -> str:
        if start.transport not in TRANSPORTS:
            return f"transport {start.transport!r}: expected one of {', '.join(TRANSPORTS)}"
        if start.transport == "unixsock-stream":  # whose address would be a path of this host
            return f"transport {start.transport!r} does not leave this host"
        if start.strategy not in strategies():
            return f"strategy {start.strategy!r}: expected one of {', '.join(strategies())}"
        if not 0.0 < start.max_age_s <= self._options.max_age_s:
            return (
                f"an age limit of {start.max_age_s:g} s: this robot's host allows up to "
                f"{self._options.max_age_s:g} s (--max-age)"
            )
        return ""

    def _begin(self, work: Awaitable[None]) -> None:
        async def attempt() -> None:
            try:
                await work
            except TandemError as error:
                self._fault = str(error)
            except Exception as error:  # the operator's host must not believe that it is done
                log.exception("a request failed")
                self._fault = f"the robot's host failed: {str(error) or type(error).__name__}"

        self._fault = ""
        self._task = asyncio.create_task(attempt())

    async def _start(self, start: talk.Start) -> None:
        await self._stop()
        self._started += 1
        here = f"tcp/127.0.0.1:{free_port('tcp')}"
        there = f"{start.transport}/{self._options.address}:{self._options.port}"
        stack = AsyncExitStack()
        self._running = stack
        session = await stack.enter_async_context(open_session(LinkConfig(connect=[here])))
        self._link = session.link(self._config.robot)
        self._observer = Observer(self._link, self._config.skeleton)
        self._recorder = MessageKeeper()
        self._observer.listeners.append(self._recorder.hear)
        self._child = Child("slave", self._folder, name=f"slave-{self._started}")
        stack.push_async_callback(self._child.stop)
        overrides = [
            f'link.listen=["{there}", "{here}"]', "link.connect=[]", 'link.mode="peer"',
            f'track.strategy="{start.strategy}"', f"guard.max_age_s={start.max_age_s}",
            'camera={ source = "off" }',
        ]  # fmt: skip
        await self._child.start(self._options.config, overrides)
        deadline_ns = monotonic_ns() + to_ns(UP_S)
        while self._observer.state is None:
            self._child.check()
            if monotonic_ns() > deadline_ns:
                raise TandemError(f"the slave publishes no state: {self._child.last_lines()}")
            await asyncio.sleep(LOOK_S)
        log.info("slave %d: %s at %s", self._started, start.strategy, there)

    async def _engage(self, operator: str) -> None:
        link = self._link
        assert link is not None
        request = ControlRequest(self._config.robot, Action.ENGAGE, operator)
        reply = await ask_control(lambda payload: link.ask(CONTROL.of(operator), payload), request)
        if not reply.done:
            raise TandemError(f"engage was refused: {reply.text}")

    async def _stop(self) -> None:
        running, self._running = self._running, None
        self._child = self._observer = self._link = None
        if running is not None:
            await running.aclose()

    def _situation(self, refusal: str) -> talk.TalkAnswer:
        observer, child = self._observer, self._child
        state = observer.state if observer is not None else None
        taking = False
        if state is not None and state.guard == "hold" and state.echo is not None:
            taking = state.sent_ns - state.echo.received_ns < to_ns(2.0 / COMMAND.rate_hz)
        return talk.TalkAnswer(
            taken=not refusal,
            busy=self._task is not None and not self._task.done(),
            fault=refusal or self._take_fault() or self._died(),
            port=self._options.port if child is not None else 0,
            guard=state.guard if state is not None else "",
            reason=state.reason if state is not None else "",
            taking=taking,
            total=len(self._kept.states),
            cpu_percent=child.cpu_percent if child is not None else 0.0,
        )

    def _take_fault(self) -> str:
        """Why the last request failed; given once, when it is over."""
        if self._task is not None and not self._task.done():
            return ""
        fault, self._fault = self._fault, ""
        return fault

    def _died(self) -> str:
        try:
            if self._child is not None:
                self._child.check()
        except TandemError as error:
            return str(error)
        return ""

    def _page(self, first: int) -> talk.TalkAnswer:
        page = self._kept.states[first : first + talk.PAGE]
        statistics = [] if first else self._kept.statistics
        return talk.TalkAnswer(
            total=len(self._kept.states),
            states=[encode(state) for state in page],
            statistics=[encode(one) for one in statistics],
        )


async def serve(options: ServeOptions, stop: asyncio.Event) -> None:
    """Serve until `stop` is set. Raises ConfigError, LinkError."""
    with tempfile.TemporaryDirectory(prefix="tandem-trial-") as folder:
        await until_stopped(stop, RobotHost(options, Path(folder)).run())
