"""Run experiments over seeds, on several cores where there are; each seed is a run of its own."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed

from deploy.accuracy.papers.figures import Experiment, Figure

MOST_JOBS = 4
"""A run holds some 150 MB."""

Done = tuple[Experiment, int, list[Figure]]


def run_all(
    experiments: Sequence[Experiment], seeds: Sequence[int], jobs: int | None = None
) -> Iterator[Done]:
    """Every experiment with every seed, as they finish. `jobs` None: one a core; 1: in this process."""
    jobs = jobs or min(os.cpu_count() or 1, MOST_JOBS)
    work = [(experiment, seed) for experiment in experiments for seed in seeds]
    if jobs == 1 or len(work) == 1:
        for experiment, seed in work:
            yield experiment, seed, experiment.run(seed)
        return
    # spawn: a fork would copy this process's threads' locks
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {pool.submit(experiment.run, seed): (experiment, seed) for experiment, seed in work}
        try:
            for future in as_completed(futures):
                experiment, seed = futures[future]
                yield experiment, seed, future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
