"""`tandem accuracy FILE...`: the orientation filters on recordings, a table, a picture and a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deploy.report.options import ReportFile
from deploy.report.output import in_a_folder, write_json


def files(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Recordings of one node each: .npz with gyr, acc and rate_hz, and if "
            "known mag, quat and movement; or any format of docs/recordings.md.",
        ),
    ],
    filter_: Annotated[
        str, typer.Option("--filter", help="Orientation filter to score: vqf, mahony, ekf or all.")
    ] = "all",
    report: ReportFile = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the errors over time into this PNG file; by default beside the report.",
            dir_okay=False,
            callback=in_a_folder,
        ),
    ] = None,
    align: Annotated[
        bool,
        typer.Option(
            "--align",
            help="Remove one constant rotation in the world frame and one in the sensor "
            "frame before scoring, and print them.",
        ),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(help="Number of processes at once; by default one per core, at most 4.", min=1),
    ] = None,
) -> None:
    """Score the orientation filters on recordings, sample by sample, by BROAD's measure.

    The cost in µs per sample is measured separately, one filter at a time, over the first 2,000 samples.
    If a file has no optical truth (`quat`), the filters are compared with the first filter.

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
    console.print(accuracy_of_files(judged))
    if report is not None:
        write_json(report, judged.tree())
    picture = plot or (report.with_suffix(".png") if report is not None else None)
    if picture is not None and any(panel.curves for panel in judged.panels):
        draw(judged.panels, picture)
        console.print(f"errors over time: {picture}", highlight=False)
