"""Robots' status for a person: a row each, then in words what is wrong or worth knowing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from common.metrics.parts import Summary
from deploy.client.clocks import clock_words
from deploy.client.efforts import largest, without_detection, without_torque_limit
from deploy.client.status import RobotStatus
from deploy.report.tables import GUARD_STYLE, UNKNOWN, plain_table


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
    words += [(f"one path of two: {lacking}", "yellow") for lacking in one.paths]
    words += clock_words(one.clocks)
    if one.blind is not None:
        words.append((one.blind, ""))
    if one.times is not None:
        words.append((one.times.words, ""))
        words += [(one.times.beyond, "red")] * bool(one.times.beyond)
    if one.command_rate and one.rate is not None:
        line = f"commands: {one.command_rate}; the robot would take {one.rate.wanted_hz or 0:g} Hz"
        words.append((f"{line} ({one.rate.words})", "yellow" if one.rate.falls else ""))
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
