"""One robot's status: its answer, its newest state, and its figures of the last second."""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress
from dataclasses import dataclass, field

from common.clock import to_ms
from common.latency.one_way import master_offset
from common.link import Link, open_session
from common.metrics.parts import Summary, Ticks
from common.metrics.slave import DueMetrics, GuardTimes, LeaseMetrics, OffsetMetrics, RateMetrics
from common.skeleton import load_skeleton
from common.skeleton.load import profile_names
from common.wire.messages import Action, RobotState
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask
from deploy.client.destination import ROUTER_S, Destination
from deploy.client.efforts import TorquesByJoint, by_joint
from deploy.client.heard import Heard, HeardOfAll
from deploy.client.shift import shift_lines
from slave.model.ends import limb_ends

LISTEN_S = 1.5
"""Statistics come once a second."""


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
    clocks: OffsetMetrics | None
    """What bounds one-way times, and why."""
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
    rate: RateMetrics | None = None
    """Of the commands, as the robot sees it."""
    command_rate: str = ""
    """Of the commands, as the operator's side says."""
    paths: tuple[str, ...] = ()
    """Of two paths, which one does not carry, as the robot and the operator's host see it."""


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
        clocks=metrics.offset if metrics else None,
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
        rate=metrics.rate if metrics else None,
        command_rate=heard.master.command_rate if heard.master else "",
        paths=_paths(heard),
    )


def _paths(heard: Heard) -> tuple[str, ...]:
    sides = {"robot": heard.metrics, "operator": heard.master}
    return tuple(f"{side}: {one.paths}" for side, one in sides.items() if one is not None and one.paths)


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
