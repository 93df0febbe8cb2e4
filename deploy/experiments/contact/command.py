"""`tandem contact`: tries the contact detection on a simulated patient, and on motions through the air."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from common.errors import TandemError
from deploy.report.options import ReportFile
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
    minutes: Annotated[
        float, typer.Option(help="Follow each motion through the air for so long, too.", min=0.0)
    ] = 0.0,
    payload_kg: Annotated[
        float,
        typer.Option(help="On those ways the right hand carries so much that nobody declared.", min=0.0),
    ] = 0.0,
    person: Annotated[
        Path | None,
        typer.Option(
            help="Recorded joint angles of people (.npz) to follow, too.", exists=True, dir_okay=False
        ),
    ] = None,
    report: ReportFile = None,
) -> None:
    """Let the simulated robot meet a soft patient with hand, forearm and elbow, noticed and not.

    The patient has 4 kg and 10 kN/m, is free to move or clamped against a wall, and is met at 0.25, 0.5 and
    1 m/s. With `--minutes`, the robot then follows motions through the air, and each stop is a false one.

    Example: `tandem contact --drive-bits 16 --minutes 5`
    """
    from deploy.experiments.contact.trials import MEETINGS, fly, pair
    from deploy.experiments.contact.view import flights_table, judge, pairs_table
    from deploy.measure.verdict import failed, verdict_table

    console = Console()
    pairs = [
        pair(meeting, reflex, drive_bits)
        for meeting in track(MEETINGS, "meeting the patient", console=console, transient=True)
    ]
    console.print(pairs_table(pairs))
    flights = fly(60.0 * minutes, payload_kg, drive_bits, person) if minutes else {}
    if flights:
        console.print(flights_table(flights))
    verdicts = judge(pairs, flights)
    console.print(verdict_table("", verdicts))
    if report is not None:
        tree = {
            "meetings": [asdict(one) for one in pairs],
            "flights": {name: asdict(one) for name, one in flights.items()},
            "verdicts": [verdict.tree() for verdict in verdicts],
        }
        try:
            report.write_text(json.dumps(tree, indent=2) + "\n", "utf-8")
        except OSError as error:
            raise TandemError(f"not written: {error}") from None
    if failed(verdicts):
        raise TandemError("a target is missed")
