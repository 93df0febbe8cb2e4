"""`tandem accuracy FILE...`: the orientation filters on recordings, a table, a picture and a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deploy.report.output import in_a_folder, write_json


def files(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="npz of one unit: gyr, acc, rate_hz, perhaps mag, quat, movement."
        ),
    ],
    filter_: Annotated[str, typer.Option("--filter", help="vqf, mahony, ekf or all.")] = "all",
    report: Annotated[
        Path | None, typer.Option(help="Write the figures as JSON.", dir_okay=False, callback=in_a_folder)
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the errors over time (PNG); beside the report unless told.",
            dir_okay=False,
            callback=in_a_folder,
        ),
    ] = None,
    align: Annotated[
        bool,
        typer.Option(
            "--align",
            help="Take one constant rotation each side (world, sensor) out of the truth, and print it.",
        ),
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(help="Processes at once; one a core (at most 4) without it.", min=1)
    ] = None,
) -> None:
    """Score the orientation filters on recordings, sample by sample, by BROAD's measure.

    µs a sample are measured apart, one filter at a time, over each recording's first 2,000 samples.
    Where a file has no optical truth (`quat`), how far the filters are from the first of them.

    Example: `tandem accuracy recording.npz --filter all --report scores.json --plot errors.png`
    """
    from rich.console import Console

    from deploy.experiments.accuracy.judge import judge
    from deploy.experiments.accuracy.picture import draw
    from deploy.experiments.accuracy.view import accuracy_of_files
    from master.orientation.filters import FILTERS

    if filter_ != "all" and filter_ not in FILTERS:
        raise typer.BadParameter(f"{filter_!r}: expected {', '.join(FILTERS)} or all", param_hint="--filter")
    console = Console()
    judged = judge(recordings, list(FILTERS) if filter_ == "all" else [filter_], console, jobs, align=align)
    console.print(accuracy_of_files(judged.tree))
    if report is not None:
        write_json(report, judged.tree)
    picture = plot or (report.with_suffix(".png") if report is not None else None)
    if picture is not None and any(panel.curves for panel in judged.panels):
        draw(judged.panels, picture)
        console.print(f"errors over time: {picture}", highlight=False)
