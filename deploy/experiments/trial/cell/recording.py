"""The messages that one cell received, and when its outage was. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from common.latency.one_way import master_offset
from common.metrics.master import MasterMetrics
from common.metrics.slave import GuardMetrics, SlaveMetrics
from common.skeleton import Skeleton
from common.wire.messages import Command, CommandEcho, RobotState, Statistics, Truth
from deploy.measure import Trace

_Metrics = TypeVar("_Metrics", MasterMetrics, SlaveMetrics)


@dataclass(frozen=True, slots=True)
class CellMessages:
    """The messages of a stretch of time; all stamps are of the master's clock."""

    commands: Sequence[Command]
    states: Sequence[RobotState]
    truth: Sequence[Truth]
    statistics: Sequence[Statistics]
    """Once a second, from each process; each counts from its start."""

    def trace(self, skeleton: Skeleton) -> Trace:
        """To be judged by."""
        trace = Trace(skeleton.joint_names)
        for messages in (self.truth, self.commands, self.states):
            for message in messages:
                trace.add(message)
        return trace


@dataclass(frozen=True, slots=True)
class ScriptedOutage:
    """The scripted outage after the judged time, ns of the master's clock."""

    cut_ns: int
    back_ns: int
    """The link carries again."""
    ready_ns: int | None
    """The operator may engage; None where the robot never became ready."""
    act_ns: int | None
    """The operator engages."""


@dataclass(frozen=True, slots=True)
class CellCourse:
    """A whole cell: the judged time, then the outage where the plan has one."""

    judged: CellMessages
    max_age_s: float
    """The guard's limit."""
    shared_clock: bool
    """Whether both sides' stamps are of one machine's clock, so that one-way figures can be checked."""
    after: CellMessages | None = None
    """From the cut on."""
    outage: ScriptedOutage | None = None
    cpu_percent: dict[str, float] = field(default_factory=dict)
    """By process, over the judged time."""
    up_bytes_s: float | None = None
    """On the wire, operator to robot."""
    down_bytes_s: float | None = None
    remarks: tuple[str, ...] = ()


def on_masters_clock(states: Iterable[RobotState]) -> list[RobotState]:
    """States of a robot with a clock of its own, moved by the offset that it had measured then.

    Only those whose offset was trusted: the others' stamps cannot be compared with the operator's.
    """
    moved = []
    for state in states:
        offset, echo = master_offset(state), state.echo
        if not offset.trusted:
            continue
        to_master = offset.remote_ns
        if echo is not None:
            echo = replace(
                echo,
                received_ns=to_master(echo.received_ns),
                accepted_ns=to_master(echo.accepted_ns),
                written_ns=to_master(echo.written_ns) if echo.written_ns else 0,
            )
        moved.append(
            replace(
                state, sent_ns=to_master(state.sent_ns), encoder_ns=to_master(state.encoder_ns), echo=echo
            )
        )
    return moved


def latest_bound_ns(states: Sequence[RobotState]) -> int | None:
    """The widest bound of a trusted offset among them."""
    return max((o.bound_ns for o in map(master_offset, states) if o.trusted), default=None)


@dataclass(frozen=True, slots=True)
class Published(Generic[_Metrics]):
    """What one process published, and when, ns of its own clock."""

    sent_ns: int
    metrics: _Metrics


def published(statistics: Iterable[Statistics], kind: type[_Metrics]) -> list[Published[_Metrics]]:
    """Of one process, in the order of their sending."""
    found = [Published(s.sent_ns, s.metrics) for s in statistics if isinstance(s.metrics, kind)]
    return sorted(found, key=lambda one: one.sent_ns)


def echoes(states: Sequence[RobotState]) -> dict[int, CommandEcho]:
    """The last echo of each accepted command, by its number: the one with its time of writing."""
    return {s.echo.sequence: s.echo for s in states if s.echo is not None}


def counts(heard: CellMessages) -> dict[str, dict[str, int]]:
    """The guard's events between the slave's first and last statistics, by kind and name."""
    words = published(heard.statistics, SlaveMetrics)
    if not words:
        return {}
    first, last = (_counted(words[i].metrics.guard) for i in (0, -1))
    grown = {kind: Counter(last[kind]) - Counter(first[kind]) for kind in last}
    return {kind: dict(sorted(count.items())) for kind, count in grown.items() if count}


def times_in_force(heard: CellMessages) -> list[str]:
    """The guard's times at the end of a stretch, and why, in words; [] where the robot did not tell."""
    told = [one.metrics.times for one in published(heard.statistics, SlaveMetrics) if one.metrics.times]
    return [text for text in (told[-1].words, told[-1].beyond) if text] if told else []


def oldest_allowed_s(heard: CellMessages, otherwise_s: float) -> float:
    """The highest age limit that was in force; `otherwise_s` where the robot did not tell."""
    told = [one.metrics.times for one in published(heard.statistics, SlaveMetrics)]
    return max((times.max_age_s for times in told if times is not None), default=otherwise_s)


def _counted(guard: GuardMetrics) -> dict[str, dict[str, int]]:
    return {
        "dropped": guard.dropped,
        "losses": guard.losses,
        "clamps": guard.clamps,
        "doubts": guard.doubts,
    }
