"""The list of robots, for people and for programs. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from common.link.roster import ListedRobot, Roster
from common.metrics.tree import Metrics
from deploy.report.tables import GUARD_STYLE, UNKNOWN, number, plain_table


@dataclass(frozen=True, slots=True)
class RosterRow(Metrics):
    """One name of the list."""

    robot: str
    place: str
    software: str
    schema: int
    profile: str
    guard: str | None
    """None: it is alive, but has sent no summary lately, or two robots bear the name."""
    reason: str
    operator: str
    """Who holds the lease; empty: nobody, so that it can be claimed."""
    offered_to: str
    faults: int | None
    waits_s: float | None
    """For how long somebody there has waited for an operator; None: nobody waits."""
    words: str
    """Of the call."""
    namesakes: int
    """Other robots of the same name."""


@dataclass(frozen=True, slots=True)
class RosterRows(Metrics):
    """The whole list."""

    robots: list[RosterRow]
    operators: list[str]
    """Those whose master lives."""


def roster_rows(roster: Roster, now_ns: int) -> RosterRows:
    """The list now: who waits comes first, the longest first; then by name."""
    rows = [_row(listed, now_ns) for listed in roster.robots()]
    rows.sort(key=lambda row: (row.waits_s is None, -(row.waits_s or 0.0), row.robot))
    return RosterRows(rows, sorted(map(printable, roster.operators)))


def _row(listed: ListedRobot, now_ns: int) -> RosterRow:
    shown = list(listed.processes.values())
    newest = shown[-1]
    summary = listed.fresh(now_ns)
    waits_s = listed.waits_s(now_ns)
    several = len(shown) - 1
    reason = f"{len(shown)} robots have this name" if several else "alive, but it tells nothing of itself"
    return RosterRow(
        robot=listed.robot,
        place=printable(" and ".join(sorted(each.words for each in shown)) if several else newest.place),
        software=printable(newest.software),
        schema=newest.schema,
        profile=printable(newest.profile),
        guard=printable(summary.guard) if summary else None,
        reason=printable(summary.reason if summary else reason),
        operator=printable(summary.operator if summary else ""),
        offered_to=printable(summary.offered_to if summary else ""),
        faults=summary.faults if summary else None,
        waits_s=None if waits_s is None else round(waits_s, 1),
        words=printable(summary.call.words if summary and summary.call else ""),
        namesakes=several,
    )


def printable(words: str) -> str:
    """Words from elsewhere, without what a terminal would obey: whoever calls an operator chooses them."""
    return "".join(each if each.isprintable() else " " for each in words)


def roster_table(rows: RosterRows, missing: str = "") -> RenderableType:
    """One line a robot, and below what needs words. `missing`: why the list may lack robots."""
    table = plain_table("robot", "guard", "operator", "waits", "faults", "profile", "place")
    table.columns[-1].no_wrap, table.columns[-1].overflow = False, "fold"
    notes = [Text(missing, "bold red")] if missing else []
    for row in rows.robots:
        _add(table, row)
        if row.waits_s is not None:
            words = f": {row.words}" if row.words else ""
            notes.append(
                Text(f"{row.robot} calls for an operator{words}. tandem take --robot {row.robot}", "bold")
            )
        if row.namesakes:
            notes.append(Text(f"{row.robot}: {row.reason}: {row.place}", "bold red"))
        elif row.guard is None:
            notes.append(Text(f"{row.robot}: {row.reason}", "yellow"))
        if row.offered_to:
            notes.append(Text(f"{row.robot}: {row.operator} offers it to {row.offered_to}", "yellow"))
    there = ", ".join(rows.operators) or "none"
    waiting = sum(row.waits_s is not None for row in rows.robots)
    robots = "1 robot" if len(rows.robots) == 1 else f"{len(rows.robots)} robots"
    count = f"{robots}, {waiting} waiting; operators here: {there}"
    return Group(table, *notes, Text(count, "dim"))


def _add(table: Table, row: RosterRow) -> None:
    guard = row.guard or UNKNOWN
    table.add_row(
        row.robot,
        Text(guard, GUARD_STYLE.get(guard, "")),
        row.operator or UNKNOWN,
        Text(UNKNOWN if row.waits_s is None else waited(row.waits_s), "" if row.waits_s is None else "bold"),
        number(row.faults, 0),
        row.profile or UNKNOWN,
        row.place or UNKNOWN,
    )


def waited(seconds: float) -> str:
    """A time for people: 42 s, 3 min, 2 h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
