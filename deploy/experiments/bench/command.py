"""`tandem bench`."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console

from deploy.report.options import ReportFile
from deploy.report.output import write_json

app = typer.Typer(no_args_is_help=False)


@app.callback(invoke_without_command=True)
def bench(
    context: typer.Context,
    report: ReportFile = None,
    quick: Annotated[
        bool, typer.Option(help="Measure for a few seconds only; the results are less precise.")
    ] = False,
) -> None:
    """Measure whether this machine is fast enough to run tandem.

    Example: `tandem bench --report bench.json`
    """
    if context.invoked_subcommand is not None:
        return
    from deploy.experiments.bench.run import bench as measure

    figures = measure(quick=quick, console=Console())
    if report is not None:
        write_json(report, figures)
