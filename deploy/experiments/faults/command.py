"""`tandem faults`: tries every row of the fault matrix, and prints what the robot did."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import track

from common.errors import TandemError
from deploy.report.options import ReportFile

if TYPE_CHECKING:
    from deploy.experiments.faults.fault import Fault
    from deploy.experiments.faults.trial import Outcome


def faults(
    only: Annotated[
        list[str] | None, typer.Argument(help="Try only the faults whose names contain this text.")
    ] = None,
    report: ReportFile = None,
    page: Annotated[
        Path | None,
        typer.Option(
            help="Write the table into this Markdown page, between its two marks.",
            dir_okay=False,
            exists=True,
        ),
    ] = None,
) -> None:
    """Inject every known fault into a simulated robot, and measure how it reacts and how soon it stops.

    Example: `tandem faults "link" --report faults.json`
    """
    from deploy.experiments.faults.document import matrix, tree, within_page
    from deploy.experiments.faults.processes import PROCESS_FAULTS
    from deploy.experiments.faults.processes import tried as tried_in_processes
    from deploy.experiments.faults.table import FAULTS
    from deploy.experiments.faults.trial import run_trial
    from deploy.experiments.faults.view import print_matrix

    def wanted(fault: Fault) -> bool:
        return not only or any(word.casefold() in fault.name.casefold() for word in only)

    processes = {fault.row.name: fault for fault in PROCESS_FAULTS}
    table = [*FAULTS, *(fault.row for fault in PROCESS_FAULTS)]
    chosen = [fault for fault in table if wanted(fault)]
    if not chosen:
        raise TandemError(f"no row is named so; there are: {', '.join(fault.name for fault in table)}")
    if page is not None and len(chosen) < len(table):
        raise TandemError("a page holds the whole matrix: name no rows with --page")

    def tried(fault: Fault) -> Outcome:
        if fault.name in processes:
            return asyncio.run(tried_in_processes(processes[fault.name]))
        return run_trial(fault)

    console = Console()
    bar = track(chosen, "trying", console=console, transient=True)
    outcomes = [tried(fault) for fault in bar]
    print_matrix(outcomes, console)
    try:
        if report is not None:
            report.write_text(json.dumps([tree(o) for o in outcomes], indent=2) + "\n", "utf-8")
        if page is not None:
            page.write_text(within_page(page.read_text("utf-8"), matrix(outcomes)), "utf-8")
    except (OSError, ValueError) as error:
        raise TandemError(f"not written: {error}") from None
    broken = [o.fault.name for o in outcomes if bool(o.wrong) != bool(o.fault.missed)]
    if broken:
        raise TandemError(f"not as the table says: {', '.join(broken)}")
