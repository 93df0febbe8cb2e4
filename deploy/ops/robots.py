"""`tandem robots`: which robots are there, what they do, who commands them, and who waits for an operator."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live

from common.clock import monotonic_ns
from common.errors import TandemError
from common.link import open_session
from common.link.config import LinkConfig
from common.link.roster import Roster
from common.metrics.tree import to_tree
from common.process.runtime import run as run_until_stopped
from deploy.client.certificate import Certificate
from deploy.client.destination import ROUTER_S, destination
from deploy.client.roster_view import RosterRows, roster_rows, roster_table
from deploy.report.options import AsJson, ConnectTo

REDRAWN_S = 0.25
ONCE_S = 2.2
"""A robot that is there has sent a summary by then: one comes each second."""


def robots(
    connect: ConnectTo = None,
    robot: Annotated[
        list[str] | None, typer.Option(help="Name or pattern, such as 'ward-*'; repeat for more.")
    ] = None,
    master: Annotated[
        Path | None,
        typer.Option(help="Take endpoints and keys from this master's TOML file.", dir_okay=False),
    ] = None,
    certificate: Certificate = None,
    once: Annotated[bool, typer.Option("--once", help="Print the list once, and end.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the robots that are there, live: guard, operator, faults, and who waits for an operator.

    A robot appears when it starts and vanishes when it ends. With --json it prints one line a change.

    Example: `tandem robots --connect tcp/192.168.7.1:7448 --once`
    """
    where = destination(connect, None, master=master, certificate=certificate)
    roster = Roster(*(robot or ()))
    run_until_stopped(lambda stop: _list(where.link, roster, stop, once=once, as_json=as_json))


async def _list(link: LinkConfig, roster: Roster, stop: asyncio.Event, *, once: bool, as_json: bool) -> None:
    async with open_session(link, router_within_s=ROUTER_S) as session:
        session.watch_roster(roster)
        if once:
            await _pause(stop, ONCE_S)
            rows = roster_rows(roster, monotonic_ns())
            if as_json:
                typer.echo(json.dumps(to_tree(rows), indent=2, ensure_ascii=False))
            else:
                Console().print(roster_table(rows))
            if missing := unreached(link, session.peers):
                raise TandemError(missing)
        elif as_json:
            await _lines(roster, stop)
        else:
            await _live(roster, stop, lambda: unreached(link, session.peers))


def unreached(link: LinkConfig, peers: int) -> str:
    """Which ends do not answer, in words: robots behind them are not listed. Empty where all do."""
    doors = 1 if link.mode == "client" else len(link.connect)
    if peers >= doors:
        return ""
    which = "nobody answers" if not peers else f"{doors - peers} of {doors} endpoints do not answer"
    return f"{which} at {', '.join(link.connect)}: robots there are not listed"


async def _lines(roster: Roster, stop: asyncio.Event) -> None:
    printed = ""
    while not stop.is_set():
        rows = roster_rows(roster, monotonic_ns())
        line = json.dumps(to_tree(rows), ensure_ascii=False)
        if _without_times(rows) != printed:
            printed = _without_times(rows)
            typer.echo(line)
        await _pause(stop, REDRAWN_S)


def _without_times(rows: RosterRows) -> str:
    """What a change of is worth a line: not that a second has passed, which a reason may count."""
    tree = [replace(row, waits_s=None if row.waits_s is None else 0.0, reason="") for row in rows.robots]
    return repr((tree, rows.operators))


async def _live(roster: Roster, stop: asyncio.Event, missing: Callable[[], str]) -> None:
    with Live(auto_refresh=False, screen=False) as live:
        while not stop.is_set():
            live.update(roster_table(roster_rows(roster, monotonic_ns()), missing()), refresh=True)
            await _pause(stop, REDRAWN_S)


async def _pause(stop: asyncio.Event, seconds: float) -> None:
    try:
        async with asyncio.timeout(seconds):
            await stop.wait()
    except TimeoutError:
        return
