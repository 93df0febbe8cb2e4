"""The operator's host in a trial on separate hosts: suit and master here, the robot asked over the link."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from common.clock import monotonic_ns, to_ns
from common.config.load import load_config
from common.errors import LinkError, TandemError
from common.link import Link, open_link, open_session
from common.link.config import LinkConfig, TlsConfig
from common.link.endpoint import SECURE
from common.skeleton import Skeleton, load_skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState, Statistics
from common.wire.topics import STATE, STATISTICS, Topic
from deploy.examples.profiles import example
from deploy.experiments.trial.cell.choice import why_impossible
from deploy.experiments.trial.cell.conclude import conclude, open_tape
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan
from deploy.experiments.trial.cell.recorder import MessageKeeper
from deploy.experiments.trial.cell.recording import CellCourse, on_masters_clock
from deploy.experiments.trial.cell.remarks import hold_remarks
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.cell.tape import JUDGED, NEITHER, CellTape
from deploy.experiments.trial.remote import talk
from deploy.harness.endpoints import Endpoints, free_port
from deploy.harness.engage import EngageDriver, keep_engaged, until_all_track
from deploy.harness.operator import GuardSight, Operator, OperatorPatience
from deploy.harness.rig import OPERATOR, ROBOT, Rig
from slave.config import SlaveConfig

START_S = 30.0
ALIGN_S = 25.0
LOOK_S = 0.2


class Partner:
    """The robot's host, asked over the link."""

    def __init__(self, link: Link, stop: asyncio.Event) -> None:
        self._link = link
        self._stop = stop

    async def look(self) -> talk.TalkAnswer:
        """The situation over there. Raises TandemError."""
        return await self._ask(talk.Look())

    async def do(self, request: talk.Request) -> talk.TalkAnswer:
        """Send a request and wait until it is done. Raises TandemError where it failed."""
        answer = await self._ask(request)
        while answer.busy:
            await asyncio.sleep(LOOK_S)
            answer = await self.look()
        if answer.fault:
            raise TandemError(f"the robot's host: {answer.fault}")
        return answer

    async def until(
        self, reached: Callable[[talk.TalkAnswer], bool], timeout_s: float, what: str
    ) -> talk.TalkAnswer:
        """Look until a condition holds. Raises TandemError where it takes too long, or the slave ended."""
        deadline_ns = monotonic_ns() + to_ns(timeout_s)
        while True:
            answer = await self.look()
            if answer.fault:
                raise TandemError(f"the robot's host: {answer.fault}")
            if reached(answer):
                return answer
            if monotonic_ns() > deadline_ns:
                raise TandemError(f"no {what} within {timeout_s:g} s: {answer.guard}, {answer.reason}")
            await asyncio.sleep(LOOK_S)

    async def kept(
        self, skeleton: Skeleton, tape: CellTape | None = None
    ) -> tuple[list[RobotState], list[Statistics]]:
        """The robot's messages while it was recorded, with its own clock's stamps. Raises TandemError."""
        states: list[RobotState] = []
        statistics: list[Statistics] = []
        if tape is not None:
            tape.stretch(JUDGED)
        while True:
            page = await self._ask(talk.Page(first=len(states)))
            states += [decode(payload, RobotState, len(skeleton.joints)) for payload in page.states]
            statistics += [decode(payload, Statistics) for payload in page.statistics]
            if tape is not None:
                for topic, payloads in ((STATE, page.states), (STATISTICS, page.statistics)):
                    for payload in payloads:
                        tape.hear(topic, payload, monotonic_ns())
            if len(states) >= page.total or not page.states:
                return states, statistics

    async def _ask(self, request: talk.Request) -> talk.TalkAnswer:
        if self._stop.is_set():
            raise TandemError("interrupted")
        answer = talk.read_answer(await self._link.ask(talk.TALK, talk.pack(request)))
        if not answer.taken:
            raise TandemError(f"the robot's host: {answer.fault}")
        return answer


class PartnerRobot:
    """The robot over there: seen and engaged through its host."""

    def __init__(self, partner: Partner) -> None:
        self._partner = partner
        self._ready = False

    @property
    def ready(self) -> bool:
        """Whether the robot holds and takes the operator's commands."""
        return self._ready

    async def look(self) -> Sequence[GuardSight]:
        """How its guard stands now. Raises TandemError."""
        answer = await self._partner.look()
        if answer.fault:
            raise TandemError(f"the robot's host: {answer.fault}")
        self._ready = answer.taking
        return [GuardSight(monotonic_ns(), answer.guard, answer.reason)]

    async def engage(self) -> str:
        """Ask the robot to engage; its refusal, empty where it engages."""
        try:
            await self._partner.do(talk.Engage(operator=OPERATOR))
        except TandemError as error:
            return str(error)
        return ""


async def run_remote_cell(
    plan: TrialPlan,
    key: CellKey,
    stop: asyncio.Event,
    show: Callable[[str], None],
    tls: TlsConfig | None = None,
    folder: Path | None = None,
) -> Cell:
    """One cell over a real network. What goes wrong is its result; only an interruption raises TandemError.

    `tls`: this host's keys, for the secure transports. `folder`: of the trial, for the cell's recording.
    """
    reason = why_impossible(key.setup.transport)
    if reason is None and key.setup.transport in SECURE and tls is None:
        reason = "no keys: name a file with [link.tls] by --link, and one over there (see `tandem keys`)"
    if reason is not None:
        return Cell(key, CellStatus.IMPOSSIBLE, reason)
    slave = [f'track.strategy="{key.setup.strategy}"', f"guard.max_age_s={plan.max_age_s}"]
    config = load_config(example("slave", plan.robot), SlaveConfig, slave)
    settings = {"guard.max_age_s": f"{plan.max_age_s:g}"}
    tape = open_tape(folder, key, config, settings)
    try:
        async with open_link(LinkConfig(connect=[plan.hosts], tls=tls), ROBOT) as link:
            await link.connected(talk.TALK)
            partner = Partner(link, stop)
            try:
                course = await _play(plan, key, partner, show, tls, tape)
            finally:
                await _farewell(link)
    except TandemError as error:
        if tape is not None:
            tape.close(None)
        if stop.is_set():
            raise TandemError("interrupted") from None
        return Cell(key, CellStatus.FAILED, str(error), settings=settings)
    show("judging")
    return await asyncio.to_thread(conclude, key, course, config, settings, (), tape)


async def _farewell(link: Link) -> None:
    """Stop the slave over there, also where all is over here; it stops by itself where nobody asks."""
    try:
        await link.ask(talk.TALK, talk.pack(talk.Stop()))
    except LinkError:
        return


async def _play(
    plan: TrialPlan,
    key: CellKey,
    partner: Partner,
    show: Callable[[str], None],
    tls: TlsConfig | None,
    tape: CellTape | None,
) -> CellCourse:
    skeleton = load_skeleton(plan.robot)
    show("starting the robot over there")
    request = talk.Start(transport=key.setup.transport, strategy=key.setup.strategy, max_age_s=plan.max_age_s)
    there = await partner.do(request)
    robot = f"{key.setup.transport}/{robots_host(plan.hosts)}:{there.port}"
    async with _operators_rig(plan, key, robot, tls) as rig:
        recorder = MessageKeeper(tape)
        rig.observer.listeners.append(recorder.hear)
        if tape is not None:
            rig.observer.tapes.append(partial(_hear_operator, tape))
        for name in ("suit", "master"):
            await rig.start(name)
        await rig.until(lambda: rig.observer.command is not None, START_S, "command of the master")
        await partner.until(lambda a: a.taking and _whole(rig), START_S, "readiness of the robot")
        show("aligning")
        check = partial(_check, rig)
        wanted = Operator(ROBOT, OperatorPatience(ALIGN_S), wanted_ns=monotonic_ns())
        await until_all_track([EngageDriver(wanted, PartnerRobot(partner))], check, LOOK_S)
        show(f"following for {plan.seconds:g} s")
        await partner.do(talk.Record())
        recorder.take(JUDGED)
        for child in rig.children.values():
            child.measure(first=True)
        began_ns, operator = monotonic_ns(), Operator(ROBOT, guard="track")
        await keep_engaged([EngageDriver(operator, PartnerRobot(partner))], plan.seconds, check, LOOK_S)
        heard = recorder.take(NEITHER)
        answer = await partner.do(talk.EndRecording())
        for child in rig.children.values():
            child.measure()
        cpu = {"master": rig.children["master"].cpu_percent, "slave": answer.cpu_percent}
        show("fetching the robot's messages")
        states, statistics = await partner.kept(skeleton, tape)
    remarks = tuple(hold_remarks(operator.holds, began_ns))
    judged_time = replace(heard, states=on_masters_clock(states), statistics=[*heard.statistics, *statistics])
    return CellCourse(judged_time, plan.max_age_s, shared_clock=False, cpu_percent=cpu, remarks=remarks)


def _hear_operator(tape: CellTape, topic: Topic, payload: bytes, arrived_ns: int) -> None:
    """The robot's states come from its own host, after the judged time."""
    if topic.name != STATE.name:
        tape.hear(topic, payload, arrived_ns)


def _check(rig: Rig) -> None:
    for name in ("suit", "master"):
        rig.children[name].check()


def _whole(rig: Rig) -> bool:
    command = rig.observer.command
    return command is not None and bool(command.valid.all())


def robots_host(endpoint: str) -> str:
    """`192.168.7.2` of `tcp/192.168.7.2:7440`."""
    return endpoint.partition("/")[2].partition("?")[0].rpartition(":")[0]


def _keys(tls: TlsConfig | None) -> list[str]:
    if tls is None:
        return []
    files = {"ca": tls.ca, "certificate": tls.certificate, "key": tls.key}
    return [f'link.tls.{name}="{path.resolve()}"' for name, path in files.items()]


@asynccontextmanager
async def _operators_rig(
    plan: TrialPlan, key: CellKey, robot: str, tls: TlsConfig | None
) -> AsyncIterator[Rig]:
    """Suit and master here, watched on loopback; the master connects to the robot over there."""
    ends = Endpoints(
        (robot,), f"tcp/127.0.0.1:{free_port('tcp')}", f"tcp/127.0.0.1:{free_port('tcp')}", free_port("udp")
    )
    overrides = {
        "suit": [f"seed={plan.seed_of(key)}", f'motion="{plan.motion}"'],
        "master": ["estimation.zero_pose_s=1.0", *_keys(tls if key.setup.transport in SECURE else None)],
    }
    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-")))
        watching = LinkConfig(listen=[ends.observer], connect=[ends.master])
        session = await stack.enter_async_context(open_session(watching))
        rig = Rig(folder, ends, overrides, session, plan.robot)
        stack.push_async_callback(rig.stop)
        yield rig
