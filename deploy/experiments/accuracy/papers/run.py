"""Run experiments over seeds, on several cores where there are; each seed is a run of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from deploy.experiments.accuracy.papers.figures import Experiment, PaperValue
from deploy.harness.workers import OnProgress, jobs_here, run_each

Done = tuple[Experiment, int, list[PaperValue]]


def run_all(
    experiments: Sequence[Experiment], seeds: Sequence[int], jobs: int | None = None
) -> Iterator[Done]:
    """Every experiment with every seed, as they finish. `jobs` None: one a core; 1: in this process."""
    work = [(experiment, seed) for experiment in experiments for seed in seeds]
    for (experiment, seed), figures in run_each(_run, work, jobs or jobs_here()):
        yield experiment, seed, figures


def _run(work: tuple[Experiment, int], _: OnProgress) -> list[PaperValue]:
    experiment, seed = work
    return experiment.run(seed)
