"""`tandem faults`: tries every row of the fault matrix, and prints what the robot did."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from common.errors import TandemError
from deploy.report.options import ReportFile


def faults(
    only: Annotated[
        list[str] | None, typer.Argument(help="Try only the faults whose names contain this text.")
    ] = None,
    report: ReportFile = None,
    profile: Annotated[
        str, typer.Option(help="Robot profile: its name, file or folder. Rows of processes: nursing only.")
    ] = "nursing",
    page: Annotated[
        Path | None,
        typer.Option(
            help="Write the table into this Markdown page, between its two marks.",
            dir_okay=False,
            exists=True,
        ),
    ] = None,
    hazards: Annotated[
        Path | None,
        typer.Option(
            help="Write the hazard table of a risk file: .csv, .json, or into a .md page between its marks.",
            dir_okay=False,
        ),
    ] = None,
) -> None:
    """Inject every known fault into a simulated robot, and measure how it reacts and how soon it stops.

    A robot of one's own is met, loaded and stopped at parts that are found from its model; rows that do not
    apply to it are told with what it lacks.

    Example: `tandem faults "link" --report faults.json`, `tandem faults contact --profile my_robot`
    """
    from deploy.examples.profiles import NURSING
    from deploy.experiments.faults.document import matrix, tree, within_page
    from deploy.experiments.faults.hazard_table import write_hazards
    from deploy.experiments.faults.view import print_matrix
    from deploy.harness.faults.table import FAULTS, faults_of, not_applicable, try_fault

    table = FAULTS if profile == NURSING else faults_of(profile)
    lacking = not_applicable(profile)
    words = [word.casefold() for word in only or [""]]
    chosen = [row for name, row in table.items() if any(word in name.casefold() for word in words)]
    left_out = {n: why for n, why in lacking.items() if any(word in n.casefold() for word in words)}
    if not chosen and not left_out:
        raise TandemError(f"no row's name contains that; the rows are: {', '.join(table)}")
    if (page or hazards) is not None and len(chosen) < len(table):
        raise TandemError("a page holds the whole matrix: name no rows with --page or --hazards")

    console = Console()
    outcomes = [try_fault(row) for row in track(chosen, "trying", console=console, transient=True)]
    print_matrix(outcomes, console)
    for name, why in left_out.items():
        console.print(f"{name}: does not apply: {why}")
    try:
        if report is not None:
            report.write_text(json.dumps([tree(o) for o in outcomes], indent=2) + "\n", "utf-8")
        if page is not None:
            page.write_text(within_page(page.read_text("utf-8"), matrix(outcomes, lacking)), "utf-8")
        if hazards is not None:
            write_hazards(hazards, outcomes)
    except (OSError, ValueError) as error:
        raise TandemError(f"not written: {error}") from None
    broken = [o.fault.name for o in outcomes if bool(o.wrong) != bool(o.fault.missed)]
    if broken:
        raise TandemError(f"not as the table says: {', '.join(broken)}")
