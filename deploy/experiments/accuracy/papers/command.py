"""`tandem accuracy papers`."""

from __future__ import annotations

from typing import Annotated

import typer

from deploy.report.options import ReportFile
from deploy.report.output import write_json


def papers(
    seeds: Annotated[
        int, typer.Option(help="Number of random seeds; each gives other sensor errors.", min=1)
    ] = 5,
    only: Annotated[
        str | None, typer.Option(metavar="KEYS", help="Run only these experiments, such as `A,C`.")
    ] = None,
    report: ReportFile = None,
    strict: Annotated[bool, typer.Option(help="Exit with status 1 if a target fails.")] = False,
    jobs: Annotated[
        int | None,
        typer.Option(help="Number of processes at once; by default one per core, at most 4.", min=1),
    ] = None,
) -> None:
    """Repeat the papers' experiments on the simulated suit, and print the results beside the papers'.

    Example: `tandem accuracy papers --seeds 5 --only A,B --report papers.json`
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from deploy.experiments.accuracy.papers.experiments import EXPERIMENTS
    from deploy.experiments.accuracy.papers.figures import PaperValue, gather, run_experiment
    from deploy.experiments.accuracy.papers.table import experiment_table, experiment_tree
    from deploy.harness.workers import jobs_here, run_each
    from deploy.measure.verdict import Outcome

    keys = [key.strip() for key in (only or "").split(",") if key.strip()]
    known = [experiment.key for experiment in EXPERIMENTS]
    unknown = [key for key in keys if key.lower() not in (k.lower() for k in known)]
    if unknown:
        raise typer.BadParameter(f"there is no {', '.join(unknown)}; there are {', '.join(known)}")
    wanted = [e for e in EXPERIMENTS if not keys or e.key.lower() in (k.lower() for k in keys)]
    found: dict[str, dict[int, list[PaperValue]]] = {experiment.key: {} for experiment in wanted}
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    work = [(experiment, seed) for experiment in wanted for seed in range(1, seeds + 1)]
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("experiments × seeds", total=len(work))
        for (experiment, seed), figures in run_each(run_experiment, work, jobs or jobs_here()):
            found[experiment.key][seed] = figures
            progress.advance(task)
    trees: dict[str, object] = {}
    missed = 0
    for experiment in wanted:
        rows = gather(dict(sorted(found[experiment.key].items())))
        missed += sum(row.outcome is Outcome.FAILED for row in rows)
        trees[experiment.key] = experiment_tree(experiment, rows)
        console.print(experiment_table(experiment, rows))
    console.print(f"{seeds} seeds; " + (f"targets failed: {missed}" if missed else "every target passed"))
    if report is not None:
        write_json(report, {"seeds": seeds, "failed": missed, "experiments": trees})
    if strict and missed:
        raise typer.Exit(1)
