"""Every filter on every recording: its scores, and its errors over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from common.quaternion import Array
from deploy.experiments.accuracy.broad import Score, errors, score, with_heading_of
from deploy.experiments.accuracy.frames import FrameRotations, fit, hint
from deploy.experiments.accuracy.online import FilterRun, run_online
from deploy.experiments.accuracy.picture import Panel
from deploy.experiments.accuracy.recording import Trial, load_trial
from deploy.harness.workers import OnProgress, jobs_here, run_each
from deploy.measure.timing import Figures
from master.orientation.filter import OrientationFilter
from master.orientation.filters import FILTERS

PARTS = ("total", "heading", "inclination")
_LITTLE = 30_000
"""Samples × filters; below this, starting processes takes longer than the work."""
_TIMED = 2000
"""Samples over which the cost of one is measured."""


@dataclass(frozen=True, slots=True)
class FilterScore:
    """One filter on one recording."""

    us_per_sample: Figures
    score: Score | None
    """Against the truth, or against the first filter; None for the first filter itself."""
    aligned: FrameRotations | None = None

    def tree(self, reference: str | None) -> dict[str, object]:
        """As JSON; `reference`: the filter that stands in for the truth."""
        out: dict[str, object] = {"us_per_sample": self.us_per_sample}
        if self.aligned is not None:
            out |= {"aligned": self.aligned.tree(), "aligned_words": self.aligned.words()}
        if self.score is not None:
            out |= asdict(self.score) if reference is None else {f"from_{reference}": asdict(self.score)}
        return out


@dataclass(frozen=True, slots=True)
class RecordingScores:
    """All filters on one recording."""

    rate_hz: float
    samples: int
    dropped: int
    magnetometer: bool
    truth: bool
    hint: str | None
    """What would explain most of the error, such as another order of the quaternion."""
    filters: Mapping[str, FilterScore]

    @property
    def reference(self) -> str | None:
        """The filter that stands in for the truth; None where there is truth."""
        return None if self.truth else next(iter(self.filters))

    def tree(self) -> dict[str, object]:
        """As JSON."""
        plain = {each.name: getattr(self, each.name) for each in fields(self)}
        return plain | {"filters": {name: f.tree(self.reference) for name, f in self.filters.items()}}


@dataclass(frozen=True, slots=True)
class AccuracyReport:
    """All filters on all recordings."""

    files: Mapping[str, RecordingScores]
    panels: Sequence[Panel]
    """One for each recording."""

    @property
    def mean(self) -> dict[str, dict[str, float | None]]:
        """Each filter's mean RMSE over the recordings with truth, °; None where one of them has no value.

        A mean of the others would be better than the filter is.
        """
        scores: dict[str, list[Score]] = {}
        for found in self.files.values():
            for name, each in found.filters.items() if found.truth else ():
                if each.score is not None:
                    scores.setdefault(name, []).append(each.score)
        keys = [f"{part}_deg" for part in PARTS]
        return {
            name: {key: _mean([getattr(score, key) for score in each]) for key in keys}
            for name, each in scores.items()
        }

    def tree(self) -> dict[str, object]:
        """As JSON: `files` ▸ name ▸ `filters` ▸ name ▸ values, and `mean` ▸ filter."""
        return {"files": {name: found.tree() for name, found in self.files.items()}, "mean": self.mean}


def judge(
    paths: Sequence[Path],
    filters: Sequence[str],
    console: Console,
    jobs: int | None = None,
    *,
    align: bool = False,
) -> AccuracyReport:
    """Read all recordings, then run each filter online over each, in `jobs` processes at once.

    `align`: take one constant rotation on each side out of the truth (`frames.fit`). `jobs` None: one for
    each core, unless there is little to do. Raises TandemError for a bad recording.
    """
    trials = {path: load_trial(path) for path in paths}
    for note in dict.fromkeys(note for trial in trials.values() for note in trial.notes):
        console.print(note, style="dim", highlight=False, markup=False)
    samples = sum(len(trial.movement) for trial in trials.values()) * len(filters)
    if jobs is None:
        jobs = 1 if samples < _LITTLE else jobs_here()
    # the slowest filter first (as a rule the last), so that no core is idle at the end
    work = [(path, name) for name in reversed(filters) for path in trials]
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    files, panels = {}, []
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("samples", total=samples)
        found = dict(run_each(_run, work, jobs, lambda count: progress.advance(task, count)))
        timing = progress.add_task("µs a sample", total=len(work))
        for path, trial in trials.items():
            runs = {}
            for name in filters:
                # timed again, alone: other processes on this machine would add to the time
                us = run_online(trial.beginning(_TIMED), _filter(trial, name), _unheard).us_per_sample
                runs[name] = FilterRun(found[path, name], us)
                progress.advance(timing)
            files[str(path)], panel = of_trial(trial, runs, align=align)
            panels.append(panel)
    return AccuracyReport(files, panels)


def _run(work: tuple[Path, str], report_progress: OnProgress) -> Array:
    """Orientations (T, 4) of one recording by one filter."""
    path, name = work
    trial = load_trial(path)
    return run_online(trial, _filter(trial, name), report_progress).q_world_from_sensor


def _filter(trial: Trial, name: str) -> OrientationFilter:
    return FILTERS[name]().make(trial.rate_hz, 1)


def _unheard(_: int) -> None:
    """Too short for a progress bar."""


def of_trial(
    trial: Trial, runs: Mapping[str, FilterRun], *, align: bool = False
) -> tuple[RecordingScores, Panel]:
    """One recording's scores and curves: against its truth, or against the first filter without one."""
    truth, reference = trial.q_world_from_sensor, next(iter(runs))
    first = runs[reference].q_world_from_sensor
    filters: dict[str, FilterScore] = {}
    curves: dict[str, dict[str, Array]] = {}
    for name, run in runs.items():
        q, turned = run.q_world_from_sensor, None
        if truth is None and name == reference:
            filters[name] = FilterScore(run.us_per_sample, None)
            continue
        against = first if truth is None else truth
        if truth is not None and align:
            turned = fit(q, truth, trial.movement)
            against = turned.applied(truth)
        found = errors(_same_heading(trial, q, against), against)
        filters[name] = FilterScore(run.us_per_sample, score(found, trial.movement), turned)
        for part in PARTS:
            curves.setdefault(part, {})[name] = np.degrees(getattr(found, part))
    words = None
    if truth is not None and not align:
        words = hint(_same_heading(trial, first, truth), truth, trial.movement)
    scores = RecordingScores(
        trial.rate_hz, len(trial.movement), int(trial.dropped.sum()), trial.has_magnetometer,
        truth is not None, words, filters,
    )  # fmt: skip
    against_words = "truth" if truth is not None else reference
    return scores, Panel(trial.name, against_words, trial.rate_hz, trial.movement, curves)


def _same_heading(trial: Trial, q: Array, against: Array) -> Array:
    return q if trial.has_magnetometer else with_heading_of(against, q, trial.movement)


def _mean(column: Sequence[float | None]) -> float | None:
    known = [value for value in column if value is not None]
    return float(np.mean(known)) if len(known) == len(column) else None
