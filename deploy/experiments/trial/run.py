"""Runs the cells that a folder lacks, one after the other, and keeps each as soon as it is there."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from rich.console import Console
from rich.live import Live

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.experiments.trial.cell.figures import BY_NAME, printed
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.progress import Progress, clock, draw

Show = Callable[[str], None]
RunCell = Callable[[TrialPlan, CellKey, asyncio.Event, Show], Awaitable[Cell]]


def missing(plan: TrialPlan, folder: Folder) -> list[CellKey]:
    """The plan's cells that are not there, or failed, in the order they are to run."""
    there = folder.cells()
    return [key for key in plan.cells() if key not in there or not there[key].settled]


async def run_trial(
    plan: TrialPlan, folder: Folder, run_cell: RunCell, stop: asyncio.Event, console: Console
) -> Progress:
    """Run until all is there or `stop` is set. Raises TandemError where the folder does not fit the plan."""
    folder.begin(plan)
    todo = missing(plan, folder)
    progress = Progress(plan, len(todo), skipped=len(plan.cells()) - len(todo))
    if todo:
        about = clock(progress.left_s(monotonic_ns()))
        console.print(f"{len(todo)} of {len(plan.cells())} cells to run, about {about}", highlight=False)
    with Live(
        console=console, refresh_per_second=4, transient=True,
        get_renderable=lambda: draw(progress, monotonic_ns()),
    ):  # fmt: skip
        for key in todo:
            if stop.is_set():
                break
            progress.begin(key, monotonic_ns())
            try:
                cell = await run_cell(plan, key, stop, lambda words: setattr(progress, "words", words))
            except TandemError:
                if stop.is_set():
                    break
                raise
            folder.keep(cell)
            progress.end(
                ran=cell.status is CellStatus.DONE,
                failed=cell.status is CellStatus.FAILED,
                now_ns=monotonic_ns(),
            )
            console.print(_line(cell), highlight=False)
    return progress


def _line(cell: Cell) -> str:
    """What a person wants to see of a cell at once."""
    key = cell.key
    head = f"[dim]{key.setup.profile}, {key.setup.name}, repeat {key.repetition}:[/]"
    if cell.status is not CellStatus.DONE:
        colour = "yellow" if cell.status is CellStatus.IMPOSSIBLE else "red"
        return f"{head} [{colour}]{cell.status}[/]: {cell.why}"
    shown = ("one_way_p50_ms", "rmse_deg", "rmse_over_latest", "roughness", "flow_s")
    figures = (f"{BY_NAME[name].title} {printed(name, cell.values.get(name), unit=True)}" for name in shown)
    return f"{head} {', '.join(figures)}"
