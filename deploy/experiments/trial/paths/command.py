"""`tandem trial paths`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from deploy.experiments.trial.cell.options import Networks, ReportFolder, Seed

SHORTEST_S = 5.0
"""Less time would end before the operator, after the cut, has engaged again."""


def paths(
    profiles: Networks = "wifi,4g",
    seconds: Annotated[
        float, typer.Option(help="Seconds of each of the six runs.", min=SHORTEST_S, max=3600.0)
    ] = 10.0,
    seed: Seed = 1,
    report: ReportFolder = Path("trial-paths"),
) -> None:
    """Compare one path with two (`[link.twin]`): while the first is whole, loses packets, and is cut.

    On a virtual clock, with no hosts and no rights; the first network is the first path. Writes `paths.json`.

    Example: `tandem trial paths --profiles wifi,4g`
    """
    from deploy.experiments.trial.cell.choice import choose
    from deploy.experiments.trial.paths.view import run_paths_trial

    run_paths_trial(choose("--profiles", profiles), seconds, seed, report, Console())
