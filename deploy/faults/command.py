"""`tandem faults`: tries every row of the fault matrix, and prints what the robot did."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from common.errors import TandemError


def faults(
    only: Annotated[list[str] | None, typer.Argument(help="Rows whose names contain this; all else.")] = None,
    report: Annotated[Path | None, typer.Option(help="Write the figures as JSON.", dir_okay=False)] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Write the matrix into this page, between its marks.", dir_okay=False, exists=True),
    ] = None,
) -> None:
    """Try what can fail on the simulated robot: what it does, how soon it stands, how fast it was.

    Example: `tandem faults "link" --report faults.json`
    """
    from deploy.faults.document import matrix, tree, within_page
    from deploy.faults.table import FAULTS
    from deploy.faults.trial import run_trial
    from deploy.faults.view import print_matrix

    chosen = [f for f in FAULTS if not only or any(word.casefold() in f.name.casefold() for word in only)]
    if not chosen:
        raise TandemError(f"no row is named so; there are: {', '.join(f.name for f in FAULTS)}")
    if page is not None and len(chosen) < len(FAULTS):
        raise TandemError("a page holds the whole matrix: name no rows with --page")
    console = Console()
    bar = track(chosen, "trying", console=console, transient=True)
    outcomes = [run_trial(fault) for fault in bar]
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
