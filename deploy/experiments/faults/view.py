"""The fault matrix on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from deploy.experiments.faults.document import figures
from deploy.harness.faults.judge import FaultOutcome


def print_matrix(outcomes: Sequence[FaultOutcome], console: Console) -> None:
    """One row a fault, and under the table whatever was not as it should be."""
    table = Table(
        box=box.SIMPLE_HEAD, pad_edge=False, caption="seconds, degrees, and shares of a speed limit"
    )
    table.add_column("what fails")
    for head in ("decided", "stood", "°/s", "share", "way", "over", "off"):
        table.add_column(head, justify="right", no_wrap=True)
    for outcome in outcomes:
        name, reacted, stood, peak, way, over, strayed = figures(outcome)
        speed, share = peak.split(" ")[0], f"{outcome.stillness.peak_share:.0%}"
        colour = ("yellow" if outcome.fault.missed else "red") if outcome.wrong else None
        table.add_row(name, reacted, stood, speed, share, way, over, strayed, style=colour)
    console.print(table)
    for outcome in outcomes:
        for word in outcome.wrong:
            console.print(f"{outcome.fault.name}: {word}", style="yellow" if outcome.fault.missed else "red")
