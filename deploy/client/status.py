"""What robots say of themselves: their answer, their newest state, and their figures of the last second."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from common.clock import to_ms
from common.errors import CodecError
from common.latency.one_way import master_offset
from common.link import Link, open_session
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import to_tree
from common.skeleton import load_skeleton
from common.skeleton.load import profile_names
from common.wire.codec import decode
from common.wire.messages import Action, RobotState, Statistics
from common.wire.topics import STATE, STATISTICS
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask
from deploy.client.destination import ROUTER_S, Destination
from deploy.report.tables import GUARD_STYLE, UNKNOWN, plain_table

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


async def ask_status(where: Destination, listen_s: float = LISTEN_S) -> dict[str, dict[str, Any]]:
    """Each robot's status as plain values. Raises LinkError where the link cannot be opened at all."""
    async with open_session(where.link, router_within_s=ROUTER_S) as session:
        links = [session.link(robot) for robot in where.robots]
        each = await asyncio.gather(*(_status(link, where, listen_s) for link in links))
    trees: dict[str, dict[str, Any]] = {}
    for answers, heard in each:
        for answer in answers:
            # of several that bear one name each is shown, by its instance number too
            name = answer.robot if len(answers) == 1 else f"{answer.robot} {answer.instance:08x}"
            trees[name] = as_tree(answer, heard.of(answer.instance), namesakes=len(answers) - 1)
    return trees


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
        """What that one said."""
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
            # which of several robots it commands is not told: it is the operator's own affair
            self._master = statistics.metrics
            for heard in self._heard.values():
                heard.take(master=statistics.metrics)


def decode_state(payload: bytes) -> RobotState | None:
    """A state of a robot of any profile; None where it is none."""
    for joints in sorted({len(load_skeleton(name).joints) for name in profile_names()}):
        try:
            return decode(payload, RobotState, joints)
        except CodecError:
            continue
    return None


def as_tree(answer: RobotAnswer, heard: Heard, namesakes: int = 0) -> dict[str, Any]:
    """A robot's status as plain JSON values; None where the robot did not tell."""
    state, metrics = heard.state, heard.metrics
    figures: Mapping[str, Any] = to_tree(metrics) if metrics else {}
    base = state.base if state else None
    return {
        "answers": bool(answer.guard),
        "guard": answer.guard or None,
        "reason": answer.text,
        "instance": answer.instance,
        "place": answer.place,
        "namesakes": namesakes,
        "operator": state.operator if state else None,
        "lease": figures.get("lease"),
        "faults": dict(state.faults) if state else None,
        "node_doubts": None if heard.master is None else heard.master.doubts,
        "encoders_invalid": int((~state.encoder_valid).sum()) if state else None,
        "base": None
        if base is None
        else {
            "tilt_deg": _degrees(base.tilt_rad),
            "inclination_deg": _degrees(base.inclination_rad),
            "azimuth_deg": _degrees(base.azimuth_rad),
            "tool_face_deg": _degrees(base.tool_face_rad),
        },
        "offset_ms": _offset(state),
        "latency_ms": {
            "one_way": figures.get("one_way_ms"),
            "one_way_corrected": figures.get("one_way_corrected_ms"),
            "end_to_end": figures.get("end_to_end_ms"),
        },
        "due": figures.get("due"),
        "ticks": figures.get("ticks"),
    }


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else round(math.degrees(angle_rad), 2)


def _offset(state: RobotState | None) -> dict[str, Any] | None:
    if state is None:
        return None
    offset = master_offset(state)
    bound_ms = to_ms(offset.bound_ns) if offset.trusted else None
    return {"offset": to_ms(offset.offset_ns), "bound": bound_ms, "trusted": offset.trusted}


def status_table(robots: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """One row a robot, then each one's reason and faults in words."""
    table = plain_table("robot", "guard", "operator", "lease s", "tilt °", "± ms", "p99 ms", "faults")
    words = [Text(f"{name}: {why}", style) for name, one in robots.items() for why, style in _words(one)]
    for name, one in robots.items():
        _add_row(table, name, one)
    return Group(table, *words)


def _add_row(table: Table, name: str, one: Mapping[str, Any]) -> None:
    guard = one["guard"] or "no answer"
    table.add_row(
        name,
        Text(guard, GUARD_STYLE.get(guard, "bold red" if not one["answers"] else "")),
        one["operator"] or UNKNOWN,
        _number((one["lease"] or {}).get("held_s"), 0),
        _number((one["base"] or {}).get("tilt_deg"), 1),
        _number((one["offset_ms"] or {}).get("bound"), 3),
        _number((one["latency_ms"]["end_to_end"] or {}).get("p99"), 1),
        UNKNOWN if one["faults"] is None else str(len(one["faults"]) + one["encoders_invalid"]),
    )


def _words(one: Mapping[str, Any]) -> Sequence[tuple[str, str]]:
    words = [(str(one["reason"]), "")]
    if one["namesakes"]:
        words.append((f"another robot has the same name; this one is at {one['place']}", "bold red"))
    words += [(f"{what}: {why}", "red") for what, why in (one["faults"] or {}).items()]
    due = one["due"]
    if due is not None and due["missing"]:
        p99, corrected = (
            (one["latency_ms"][key] or {}).get("p99") for key in ("one_way", "one_way_corrected")
        )
        missing = f"{due['missing']} of {due['expected']} commands were not there when they were due"
        how = f"one way p99 {_number(p99, 1)} ms, {_number(corrected, 1)} ms with them"
        words.append((f"{missing} ({how})", "yellow"))
    words += [(f"node {node}: {why}", "yellow") for node, why in (one["node_doubts"] or {}).items()]
    if one["encoders_invalid"]:
        words.append((f"encoders not heard: {one['encoders_invalid']}", "red"))
    return words


def _number(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
