"""`tandem bench fleet`."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.report.options import AsJson, ReportFile
from deploy.report.output import write_json


def fleet(
    robots: Annotated[int, typer.Option(help="The largest fleet.", min=1, max=20_000)] = 100,
    nurses: Annotated[int, typer.Option(help="Masters that watch it at once, in a further cell.", min=1)] = 1,
    seconds: Annotated[float, typer.Option(help="How long each fleet is measured.", min=1.0)] = 10.0,
    transport: Annotated[str, typer.Option(help="tcp, udp, ws, … without certificates.")] = "tcp",
    repeat: Annotated[int, typer.Option(help="Measure each so often; the median counts.", min=1)] = 1,
    report: ReportFile = None,
    as_json: AsJson = False,
) -> None:
    """Measure what robots cost the operator's host, watched and commanded, through a real router.

    The robots are light: real link, guard and codec, no drives and no simulator. A master without a suit
    commands them. Costs are CPU time of its process, so that other work of this machine counts little.

    Example: `tandem bench fleet --robots 1000 --nurses 2 --report fleet.json`
    """
    from deploy.experiments.bench.fleet.run import FleetOptions, measure_fleet
    from deploy.experiments.bench.fleet.view import fleet_table

    options = FleetOptions(robots, nurses, seconds, transport, repeat)
    console = Console(stderr=as_json)
    with tempfile.TemporaryDirectory() as folder, console.status("fleet") as status:
        figures = measure_fleet(options, Path(folder), lambda cell: status.update(cell))
    if report is not None:
        write_json(report, figures.tree())
    if as_json:
        typer.echo(json.dumps(figures.tree(), indent=2))
    else:
        console.print(fleet_table(figures))
    missing = [one.cell.name for one in figures.cells if not one.measured]
    if missing:
        raise TandemError(f"{'; '.join(missing)}: this machine could not serve so many robots")
