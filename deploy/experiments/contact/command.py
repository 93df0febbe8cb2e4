"""`tandem contact`: tries the contact detection on a simulated patient, and on motions through the air."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from common.errors import TandemError
from deploy.measure.verdict import Verdict
from deploy.report.options import AsJson, ReportFile
from deploy.report.output import write_json
from slave.contact.config import Reflex


def contact(
    reflex: Annotated[Reflex, typer.Option(help="What follows the protective stop.")] = Reflex.RETREAT,
    drive_bits: Annotated[
        int,
        typer.Option(
            help="Bits of a turn of the drives' own encoders; 0: output encoders only.",
            min=0,
            max=24,
        ),
    ] = 0,
    hours: Annotated[
        float,
        typer.Option(
            help="Meet nobody: follow motions through the air for so long with each load, by coarse and fine "
            "angles.",
            min=0.0,
        ),
    ] = 0.0,
    person: Annotated[
        Path | None,
        typer.Option(
            help="Recorded joint angles of people (.npz) to follow, too.", exists=True, dir_okay=False
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed of the robots' masses and noise.")] = 1,
    jobs: Annotated[int, typer.Option(help="With --hours: processes; 0: one a core.", min=0, max=64)] = 1,
    resume: Annotated[
        Path | None,
        typer.Option(help="With --hours: keep what is done in this file, and go on from it.", dir_okay=False),
    ] = None,
    as_json: AsJson = False,
    report: ReportFile = None,
) -> None:
    """Let the simulated robot meet a soft patient with hand, forearm and elbow, noticed and not.

    The patient has 4 kg and 10 kN/m, is free to move or clamped against a wall, and is met at 0.25, 0.5 and
    1 m/s. With `--hours`, the robot follows motions through the air instead, and each stop is a false one.

    For false stops: `tandem contact --hours 1 --person people.npz --resume hour.json --json`

    Example: `tandem contact --drive-bits 16`
    """
    from deploy.experiments.contact.hours import follow_for
    from deploy.harness.workers import jobs_here
    from deploy.measure.verdict import failed, verdict_table

    console = Console(stderr=as_json)
    tables, tree, verdicts = (
        follow_for(hours, person, seed, console, jobs or jobs_here(), resume)
        if hours
        else _meet_all(reflex, drive_bits, console)
    )
    for table in tables:
        console.print(table)
    console.print(verdict_table("", verdicts))
    tree = {**tree, "verdicts": [verdict.tree() for verdict in verdicts]}
    if as_json:
        typer.echo(json.dumps(tree, indent=2, ensure_ascii=False))
    if report is not None:
        write_json(report, tree)
    if failed(verdicts):
        raise TandemError("a target is missed")


def _meet_all(
    reflex: Reflex, drive_bits: int, console: Console
) -> tuple[list[Table], dict[str, object], list[Verdict]]:
    """All meetings: tables, JSON tree, verdicts."""
    from deploy.experiments.contact.trials import MEETINGS, pair
    from deploy.experiments.contact.view import judge, pairs_table

    pairs = [
        pair(meeting, reflex, drive_bits)
        for meeting in track(MEETINGS, "meeting the patient", console=console, transient=True)
    ]
    return [pairs_table(pairs)], {"meetings": [asdict(one) for one in pairs]}, judge(pairs)
