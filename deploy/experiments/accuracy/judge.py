"""Every filter on every recording: the figures as a tree, and the curves to draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from common.quaternion import Array
from deploy.experiments.accuracy.broad import OrientationErrors, errors, score, with_heading_of
from deploy.experiments.accuracy.frames import fit, hint
from deploy.experiments.accuracy.online import FilterRun, run_online
from deploy.experiments.accuracy.picture import Panel
from deploy.experiments.accuracy.recording import Trial, load_trial
from deploy.harness.workers import OnProgress, jobs_here, run_each
from master.orientation.filter import OrientationFilter
from master.orientation.filters import FILTERS

_PARTS = ("total", "heading", "inclination")
_LITTLE = 30_000
"""Samples × filters: below it starting processes takes longer than the work."""
_TIMED = 2000
"""Samples by which the cost of one is told."""


@dataclass(frozen=True, slots=True)
class JudgedRecording:
    """What came of it."""

    tree: dict[str, Any]
    """Plain JSON values: `files` ▸ name ▸ `filters` ▸ name ▸ figures, and `mean` ▸ filter over the files."""
    panels: list[Panel]
    """One a recording."""


def judge(
    paths: Sequence[Path],
    filters: Sequence[str],
    console: Console,
    jobs: int | None = None,
    *,
    align: bool = False,
) -> JudgedRecording:
    """Read all recordings, then run each filter online over each, in `jobs` processes at once.

    `align`: one constant rotation each side is taken out of the truth (`frames.fit`). `jobs` None: one a
    core, unless there is little to do. Raises TandemError for a bad recording.
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
                runs[name] = FilterRun(found[path, name], us)
                progress.advance(timing)
            figures, panel = of_trial(trial, runs, align=align)
            tree["files"][str(path)] = figures
            panels.append(panel)
    tree["mean"] = mean_over(tree["files"].values())
    return JudgedRecording(tree, panels)


def _run(work: tuple[Path, str], tell: OnProgress) -> Array:
    """Orientations (T, 4) of one recording by one filter."""
    path, name = work
    trial = load_trial(path)
    return run_online(trial, _filter(trial, name), tell).q_world_from_sensor


def _filter(trial: Trial, name: str) -> OrientationFilter:
    return FILTERS[name]().make(trial.rate_hz, 1)


def _unheard(_: int) -> None:
    """Nobody waits for so little."""


def of_trial(
    trial: Trial, runs: dict[str, FilterRun], *, align: bool = False
) -> tuple[dict[str, Any], Panel]:
    """One recording's figures and curves: against its truth, or against the first filter without one."""
    truth = trial.q_world_from_sensor
    of_filters: dict[str, dict[str, Any]] = {
        name: {"us_per_sample": run.us_per_sample} for name, run in runs.items()
    }
    out: dict[str, Any] = {
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
        of_run, q = truth, run.q_world_from_sensor
        if truth is not None and align:
            turned = fit(q, truth, trial.movement)
            of_run = turned.applied(truth)
            of_filters[name]["aligned"] = {"world": turned.world.tolist(), "sensor": turned.sensor.tolist()}
            of_filters[name]["aligned_words"] = turned.words()
        elif truth is not None and name == reference:
            out["hint"] = hint(_same_heading(trial, q, truth), truth, trial.movement)
        found = _errors(trial, q, of_run, runs[reference].q_world_from_sensor)
        figures = asdict(score(found, trial.movement))
        of_filters[name].update(figures if truth is not None else {f"from_{reference}": figures})
        for part in _PARTS:
            curves.setdefault(part, {})[name] = np.degrees(getattr(found, part))
    return out, Panel(
        trial.name, "truth" if truth is not None else reference, trial.rate_hz, trial.movement, curves
    )


def _errors(trial: Trial, q: Array, truth: Array | None, reference: Array) -> OrientationErrors:
    against = reference if truth is None else truth
    return errors(_same_heading(trial, q, against), against)


def _same_heading(trial: Trial, q: Array, against: Array) -> Array:
    return q if trial.has_magnetometer else with_heading_of(against, q, trial.movement)


def mean_over(files: Any) -> dict[str, dict[str, float | None]]:
    """Each filter's mean of the files' RMSE, °, over those with truth; None where one of them has no figure.

    A mean of the others would be better than the filter is.
    """
    keys = [f"{part}_deg" for part in _PARTS]
    rows: dict[str, list[list[float | None]]] = {}
    for figures in files:
        for name, found in figures["filters"].items():
            if figures["truth"]:
                rows.setdefault(name, []).append([found[key] for key in keys])
    return {
        name: {
            f"{part}_deg": _mean(column) for part, column in zip(_PARTS, zip(*row, strict=True), strict=True)
        }
        for name, row in rows.items()
    }


def _mean(column: tuple[float | None, ...]) -> float | None:
    known = [value for value in column if value is not None]
    return float(np.mean(known)) if len(known) == len(column) else None
