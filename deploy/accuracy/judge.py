"""Every filter on every recording: the figures as a tree, and the curves to draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from common.quaternion import Array
from deploy.accuracy.broad import Errors, errors, score, with_heading_of
from deploy.accuracy.online import Run, run_online
from deploy.accuracy.picture import Panel
from deploy.accuracy.recording import Trial, load_trial
from deploy.accuracy.spread import Tell, jobs_here, run_each
from master.fuse.filter import FilterName, OrientationFilter
from master.fuse.filters import makers

FILTERS: tuple[str, ...] = get_args(FilterName)
_PARTS = ("total", "heading", "inclination")
_LITTLE = 30_000
"""Samples × filters: below it starting processes takes longer than the work."""
_TIMED = 2000
"""Samples by which the cost of one is told."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What came of it."""

    tree: dict[str, Any]
    """Plain JSON values: `files` ▸ name ▸ `filters` ▸ name ▸ figures, and `mean` ▸ filter over the files."""
    panels: list[Panel]
    """One a recording."""


def judge(paths: Sequence[Path], filters: Sequence[str], console: Console, jobs: int | None = None) -> Judged:
    """Read all recordings, then run each filter online over each, in `jobs` processes at once.

    `jobs` None: one a core, unless there is little to do. Raises TandemError for a bad recording.
    """
    trials = {path: load_trial(path) for path in paths}
    samples = sum(len(trial.movement) for trial in trials.values()) * len(filters)
    if jobs is None:
        jobs = 1 if samples < _LITTLE else jobs_here()
    # the slowest, as a rule the last, first: no core is left idle at the end
    work = [(path, name) for name in reversed(filters) for path in trials]
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    tree: dict[str, Any] = {"files": {}}
    panels = []
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("samples", total=samples)
        found = dict(run_each(_run, work, jobs, lambda count: progress.advance(task, count)))
        timing = progress.add_task("µs a sample", total=len(work))
        for path, trial in trials.items():
            runs = {}
            for name in filters:
                # others at work on this machine would count: timed again, alone
                us = run_online(trial.beginning(_TIMED), _filter(trial, name), _unheard).us_per_sample
                runs[name] = Run(found[path, name], us)
                progress.advance(timing)
            figures, panel = of_trial(trial, runs)
            tree["files"][str(path)] = figures
            panels.append(panel)
    tree["mean"] = mean_over(tree["files"].values())
    return Judged(tree, panels)


def _run(work: tuple[Path, str], tell: Tell) -> Array:
    """Orientations (T, 4) of one recording by one filter."""
    path, name = work
    trial = load_trial(path)
    return run_online(trial, _filter(trial, name), tell).q_world_from_sensor


def _filter(trial: Trial, name: str) -> OrientationFilter:
    return makers(trial.rate_hz)[name](1)


def _unheard(_: int) -> None:
    """Nobody waits for so little."""


def of_trial(trial: Trial, runs: dict[str, Run]) -> tuple[dict[str, Any], Panel]:
    """One recording's figures and curves: against its truth, or against the first filter without one."""
    truth = trial.q_world_from_sensor
    of_filters: dict[str, dict[str, Any]] = {
        name: {"us_per_sample": run.us_per_sample} for name, run in runs.items()
    }
    out = {
        "rate_hz": trial.rate_hz,
        "samples": len(trial.movement),
        "dropped": int(trial.dropped.sum()),
        "magnetometer": trial.has_magnetometer,
        "truth": truth is not None,
        "filters": of_filters,
    }
    curves: dict[str, dict[str, Array]] = {}
    reference = next(iter(runs))
    for name, run in runs.items():
        if truth is None and name == reference:
            continue
        found = _errors(trial, run.q_world_from_sensor, truth, runs[reference].q_world_from_sensor)
        figures = asdict(score(found, trial.movement))
        of_filters[name].update(figures if truth is not None else {f"from_{reference}": figures})
        for part in _PARTS:
            curves.setdefault(part, {})[name] = np.degrees(getattr(found, part))
    return out, Panel(
        trial.name, "truth" if truth is not None else reference, trial.rate_hz, trial.movement, curves
    )


def _errors(trial: Trial, q: Array, truth: Array | None, reference: Array) -> Errors:
    against = reference if truth is None else truth
    return errors(q if trial.has_magnetometer else with_heading_of(against, q, trial.movement), against)


def mean_over(files: Any) -> dict[str, dict[str, float]]:
    """Each filter's mean of the files' RMSE, °, over those with truth."""
    rows: dict[str, list[list[float]]] = {}
    for figures in files:
        for name, found in figures["filters"].items():
            if figures["truth"]:
                rows.setdefault(name, []).append([found[f"{part}_deg"] for part in _PARTS])
    return {
        name: {f"{part}_deg": float(value) for part, value in zip(_PARTS, np.mean(row, axis=0), strict=True)}
        for name, row in rows.items()
    }
