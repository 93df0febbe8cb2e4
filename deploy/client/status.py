"""What robots say of themselves: their answer, their newest state, and their figures of the last second."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from common.clock import to_ms
from common.errors import CodecError
from common.latency.one_way import master_offset
from common.link import Link, open_session
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary, Ticks
from common.metrics.slave import DueMetrics, GuardTimes, LeaseMetrics, SlaveMetrics
from common.skeleton import load_skeleton
from common.skeleton.load import profile_names
from common.wire.codec import decode, state_joints
from common.wire.messages import Action, RobotState, Statistics
from common.wire.topics import STATE, STATISTICS
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask
from deploy.client.destination import ROUTER_S, Destination
from deploy.client.efforts import (
    TorquesByJoint,
    by_joint,
    largest,
    without_detection,
    without_torque_limit,
)
from deploy.client.shift import shift_lines
from deploy.report.tables import GUARD_STYLE, UNKNOWN, plain_table
from slave.model.ends import limb_ends

LISTEN_S = 1.5
"""Statistics come once a second."""


@dataclass(slots=True)
class Heard:
    """What one robot sent while it was listened to."""

    state: RobotState | None = None
    metrics: SlaveMetrics | None = None
    master: MasterMetrics | None = None
    """Of the master that commands it."""
    all: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when there is nothing more to wait for."""

    def take(
        self,
        state: RobotState | None = None,
        metrics: SlaveMetrics | None = None,
        master: MasterMetrics | None = None,
    ) -> None:
        """Keep what is newer."""
        self.state, self.metrics = state or self.state, metrics or self.metrics
        self.master = master or self.master
        if self.state is None or self.metrics is None:
            return
        # without a lease there may be no master to tell anything
        if self.master is not None or not self.state.operator:
            self.all.set()


async def ask_status(where: Destination, listen_s: float = LISTEN_S) -> dict[str, RobotStatus]:
    """Each robot's status by name. Raises LinkError where the link cannot be opened at all."""
    async with open_session(where.link, router_within_s=ROUTER_S) as session:
        links = [session.link(robot) for robot in where.robots]
        each = await asyncio.gather(*(_status(link, where, listen_s) for link in links))
    robots: dict[str, RobotStatus] = {}
    for answers, heard in each:
        for answer in answers:
            # of several that bear one name each is shown, by its instance number too
            name = answer.robot if len(answers) == 1 else f"{answer.robot} {answer.instance:08x}"
            robots[name] = robot_status(answer, heard.of(answer.instance), namesakes=len(answers) - 1)
    return robots


async def _status(link: Link, where: Destination, listen_s: float) -> tuple[list[RobotAnswer], HeardOfAll]:
    heard = HeardOfAll(link)
    answers = await ask(link, where, Action.STATUS)
    with suppress(TimeoutError):
        async with asyncio.timeout(listen_s):
            for answer in answers:
                if answer.done:
                    await heard.of(answer.instance).all.wait()
    return answers, heard


class HeardOfAll:
    """What each robot of one name says from now on, by instance."""

    def __init__(self, link: Link) -> None:
        self._heard: dict[int, Heard] = {}
        self._master: MasterMetrics | None = None
        link.subscribe(STATE, self._on_state)
        link.subscribe(STATISTICS, self._on_statistics)

    def of(self, instance: int) -> Heard:
        """The messages of one robot process, by its instance number."""
        if instance not in self._heard:
            self._heard[instance] = Heard(master=self._master)
        return self._heard[instance]

    def _on_state(self, payload: bytes, _: int) -> None:
        state = decode_state(payload)
        if state is not None:
            self.of(state.instance).take(state=state)

    def _on_statistics(self, payload: bytes, _: int) -> None:
        try:
            statistics = decode(payload, Statistics)
        except CodecError:
            return
        if isinstance(statistics.metrics, SlaveMetrics):
            self.of(statistics.metrics.instance).take(metrics=statistics.metrics)
        else:
            # the master's metrics do not name the robot process that it commands
            self._master = statistics.metrics
            for heard in self._heard.values():
                heard.take(master=statistics.metrics)


def decode_state(payload: bytes) -> RobotState | None:
    """A state of a robot of any profile; None where it is none."""
    try:
        return decode(payload, RobotState, state_joints(payload))
    except CodecError:
        return None


@dataclass(frozen=True, slots=True)
class BaseAngles:
    """How the robot's base is tilted, degrees; None where the robot does not know."""

    tilt_deg: float | None
    inclination_deg: float | None
    azimuth_deg: float | None
    tool_face_deg: float | None


@dataclass(frozen=True, slots=True)
class OffsetStatus:
    """The master's clock minus the slave's, ms; no bound while it is not trusted."""

    offset: float
    bound: float | None
    trusted: bool


@dataclass(frozen=True, slots=True)
class LatencyStatus:
    """Latencies of the last second, ms; None where the robot sent none."""

    one_way: Summary | None = None
    one_way_corrected: Summary | None = None
    end_to_end: Summary | None = None


@dataclass(frozen=True, slots=True)
class RobotStatus:
    """One robot's status; None where the robot did not send it."""

    answers: bool
    guard: str | None
    reason: str
    instance: int
    place: str
    namesakes: int
    """Other robots that have the same name."""
    operator: str | None
    lease: LeaseMetrics | None
    faults: dict[str, str] | None
    node_doubts: dict[str, str] | None
    switches: dict[str, str] | None
    """What the operator holds, in words."""
    encoders_invalid: int | None
    base: BaseAngles | None
    offset_ms: OffsetStatus | None
    latency_ms: LatencyStatus
    blind: str | None
    """How far each hand would go if the line died now; None while the robot follows nobody."""
    due: DueMetrics | None
    times: GuardTimes | None
    """The guard's times in force, and why."""
    ticks: Ticks | None
    shift: tuple[str, ...] = ()
    """Of the operator's shift, in words: scaled motion, raised arms."""
    resting: tuple[str, ...] = ()
    """Joint groups that hold until the operator takes them up."""
    effort_nm: TorquesByJoint | None = None
    """Of each motor at its joint, N m."""
    external_nm: TorquesByJoint | None = None
    """From outside."""
    no_effort: dict[str, str] = field(default_factory=dict)
    """Why a joint's effort is not known."""
    contact_from: str = ""
    """Below which force no push is noticed; empty where none is at all, or nothing is known."""
    no_torque_limit: dict[str, str] = field(default_factory=dict)
    """Why the drive of a joint takes no torque limit, where others do."""
    unlimited: str = ""
    """Why the drives may push harder than moving needs; empty where they may not, or nothing is known."""
    left_out: dict[str, str] = field(default_factory=dict)
    """What a joint's drive lacks that it may lack, in words."""
    not_driven: dict[str, str] = field(default_factory=dict)
    """Joints without a servo, in words."""


def robot_status(answer: RobotAnswer, heard: Heard, namesakes: int = 0) -> RobotStatus:
    """A robot's status from its answer and from what it sent."""
    state, metrics = heard.state, heard.metrics
    base = state.base if state else None
    return RobotStatus(
        answers=bool(answer.guard),
        guard=answer.guard or None,
        reason=answer.text,
        instance=answer.instance,
        place=answer.place,
        namesakes=namesakes,
        operator=state.operator if state else None,
        lease=metrics.lease if metrics else None,
        faults=dict(state.faults) if state else None,
        node_doubts=None if heard.master is None else heard.master.doubts,
        switches=None if heard.master is None else heard.master.switches,
        encoders_invalid=_not_heard(heard),
        base=None
        if base is None
        else BaseAngles(
            _degrees(base.tilt_rad),
            _degrees(base.inclination_rad),
            _degrees(base.azimuth_rad),
            _degrees(base.tool_face_rad),
        ),
        offset_ms=_offset(state),
        latency_ms=LatencyStatus(metrics.one_way_ms, metrics.one_way_corrected_ms, metrics.end_to_end_ms)
        if metrics
        else LatencyStatus(),
        blind=_blind(state),
        due=metrics.due if metrics else None,
        times=metrics.times if metrics else None,
        ticks=metrics.ticks if metrics else None,
        resting=state.resting if state else (),
        shift=shift_lines(heard.master),
        effort_nm=by_joint(state.effort_nm) if state else None,
        external_nm=by_joint(state.external_nm) if state else None,
        no_effort=metrics.servos.no_effort if metrics else {},
        contact_from=metrics.contact_from if metrics else "",
        no_torque_limit=metrics.servos.no_torque_limit if metrics else {},
        unlimited=metrics.servos.unlimited if metrics else "",
        left_out=metrics.servos.left_out if metrics else {},
        not_driven=metrics.servos.not_driven if metrics else {},
    )


def _not_heard(heard: Heard) -> int | None:
    """Encoders without a valid reading; joints without a servo have none."""
    if heard.state is None:
        return None
    absent = len(heard.metrics.servos.not_driven) if heard.metrics else 0
    return max(0, int((~heard.state.encoder_valid).sum()) - absent)


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else round(math.degrees(angle_rad), 2)


def _offset(state: RobotState | None) -> OffsetStatus | None:
    if state is None:
        return None
    offset = master_offset(state)
    bound_ms = to_ms(offset.bound_ns) if offset.trusted else None
    return OffsetStatus(to_ms(offset.offset_ns), bound_ms, offset.trusted)


def _blind(state: RobotState | None) -> str | None:
    if state is None or not state.blind_m:
        return None
    skeletons = map(load_skeleton, profile_names())
    skeleton = next((one for one in skeletons if len(one.joints) == len(state.position_rad)), None)
    # a robot of one's own: the state does not tell what its hands are called
    names = [f"limb {i + 1}" for i in range(len(state.blind_m))]
    names = list(limb_ends(skeleton).names) if skeleton is not None else names
    hands = zip(names, state.blind_m, strict=False)
    ways = ", ".join(f"{name.replace('_', ' ')} ≤ {100.0 * way_m:.1f} cm" for name, way_m in hands)
    return f"if the line died now: {ways} in {state.blind_s:.2f} s"


def status_table(robots: Mapping[str, RobotStatus]) -> RenderableType:
    """One row a robot, then each one's reason and faults in words."""
    table = plain_table("robot", "guard", "operator", "lease s", "tilt °", "± ms", "p99 ms", "faults")
    words = [Text(f"{name}: {why}", style) for name, one in robots.items() for why, style in _words(one)]
    for name, one in robots.items():
        _add_row(table, name, one)
    return Group(table, *words)


def _add_row(table: Table, name: str, one: RobotStatus) -> None:
    guard = one.guard or "no answer"
    table.add_row(
        name,
        Text(guard, GUARD_STYLE.get(guard, "" if one.answers else "bold red")),
        one.operator or UNKNOWN,
        _number(one.lease.held_s if one.lease else None, 0),
        _number(one.base.tilt_deg if one.base else None, 1),
        _number(one.offset_ms.bound if one.offset_ms else None, 3),
        _number(_p99(one.latency_ms.end_to_end), 1),
        UNKNOWN if one.faults is None else str(len(one.faults) + (one.encoders_invalid or 0)),
    )


def _words(one: RobotStatus) -> Sequence[tuple[str, str]]:
    words = [(one.reason, "")]
    if one.namesakes:
        words.append((f"another robot has the same name; this one is at {one.place}", "bold red"))
    words += [(f"{what}: {why}", "red") for what, why in (one.faults or {}).items()]
    if one.resting:
        groups = " ".join(one.resting)
        words.append((f"at rest: {groups}; to follow again: tandem take-up {groups}", "yellow"))
    words += [(line, "") for line in one.shift]
    lease = one.lease
    if lease is not None and lease.offered_to:
        left = f"{lease.offered_to} may take over within {lease.offer_left_s:.0f} s"
        words.append((f"{left}: a running master does by itself; then {lease.offered_to} engages", "yellow"))
    due, latency = one.due, one.latency_ms
    if due is not None and due.missing:
        missing = f"{due.missing} of {due.expected} commands were not there when they were due"
        p99, corrected = (_number(_p99(of), 1) for of in (latency.one_way, latency.one_way_corrected))
        words.append((f"{missing} (one way p99 {p99} ms, {corrected} ms with them)", "yellow"))
    if one.blind is not None:
        words.append((one.blind, ""))
    if one.times is not None:
        words.append((one.times.words, ""))
        words += [(one.times.beyond, "red")] * bool(one.times.beyond)
    words += [(f"{name}: {why}", "yellow") for name, why in (one.switches or {}).items() if why != "held"]
    words += [(f"node {node}: {why}", "yellow") for node, why in (one.node_doubts or {}).items()]
    words += [(line, "yellow") for line in without_detection(one.no_effort)]
    words += [(f"contact: {one.contact_from}", "dim")] * bool(one.contact_from)
    words += [(line, "yellow") for line in without_torque_limit(one.no_torque_limit)]
    words += [(f"drives push as hard as they can: {one.unlimited}", "yellow")] * bool(one.unlimited)
    words += [(f"{joint} {why}", "yellow") for joint, why in one.not_driven.items()]
    words += [(f"{joint}: its drive lacks {what}", "dim") for joint, what in one.left_out.items()]
    for what, torques in (("effort", one.effort_nm), ("from outside", one.external_nm)):
        if found := largest(torques or {}):
            words.append((f"{what}: {found} (the largest)", "dim"))
    if one.encoders_invalid:
        words.append((f"encoders not heard: {one.encoders_invalid}", "red"))
    return words


def _p99(latency: Summary | None) -> float | None:
    return latency.p99 if latency else None


def _number(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None or not math.isfinite(value) else f"{value:.{digits}f}"
