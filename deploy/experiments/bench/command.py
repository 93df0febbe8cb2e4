"""`tandem bench`."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console

from deploy.report.options import ReportFile
from deploy.report.output import write_json


def bench(
    report: ReportFile = None,
    quick: Annotated[
        bool, typer.Option(help="Measure for a few seconds only; the results are less precise.")
    ] = False,
) -> None:
    """Measure whether this machine is fast enough to run tandem.

    Example: `tandem bench --report bench.json`
    """
    from deploy.experiments.bench.run import bench as measure

    figures = measure(quick=quick, console=Console())
    if report is not None:
        write_json(report, figures)
