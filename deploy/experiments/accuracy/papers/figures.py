"""The values of an experiment beside the paper's and their targets, for one seed and over many."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from deploy.harness.workers import OnProgress
from deploy.measure.verdict import Outcome, Verdict, at_most


@dataclass(frozen=True, slots=True)
class PaperValue:
    """One value of one seed. Less is better."""

    name: str
    unit: str
    values: tuple[float, ...]
    """One for each side, axis or angle; empty where the run gave none."""
    paper: float | None = None
    """The paper's."""
    target: float | None = None
    """The most it may be; None where nothing is asked."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """One block of the output. `run` takes a seed, needs nothing else, and can be sent to another process."""

    key: str
    """Its name for `--only`."""
    title: str
    run: Callable[[int], list[PaperValue]]
    notes: tuple[str, ...] = ()
    """What a reader must know to judge the values, one sentence each."""


@dataclass(frozen=True, slots=True)
class PaperComparison:
    """A value over all seeds, beside the paper's."""

    name: str
    unit: str
    paper: float | None
    target: float | None
    by_seed: Mapping[int, tuple[float, ...]]

    @property
    def values(self) -> list[float]:
        """The values of all seeds."""
        return [value for values in self.by_seed.values() for value in values]

    @property
    def mean(self) -> float | None:
        """Over seeds and sides alike."""
        values = self.values
        return math.fsum(values) / len(values) if values else None

    @property
    def worst(self) -> float | None:
        """The largest; NaN where any is."""
        values = self.values
        if any(math.isnan(value) for value in values):
            return math.nan
        return max(values, default=None)

    @property
    def verdict(self) -> Verdict | None:
        """Whether the worst of every seed reaches the target; a seed without a value has failed it.

        None where nothing is asked.
        """
        if self.target is None:
            return None
        verdict = at_most(self.name, self.worst, self.target, self.unit)
        if not all(self.by_seed.values()):
            return replace(verdict, outcome=Outcome.FAILED, why="a seed gave no value")
        return verdict

    @property
    def outcome(self) -> Outcome | None:
        """The verdict's outcome; None where nothing is asked."""
        return None if self.verdict is None else self.verdict.outcome


def run_experiment(work: tuple[Experiment, int], _: OnProgress) -> list[PaperValue]:
    """One experiment with one seed, in any process."""
    experiment, seed = work
    return experiment.run(seed)


def gather(by_seed: Mapping[int, Sequence[PaperValue]]) -> list[PaperComparison]:
    """One comparison for each value, in the order in which they first appear."""
    found: dict[str, PaperValue] = {}
    for figures in by_seed.values():
        for figure in figures:
            found.setdefault(figure.name, figure)
    of_seed = {seed: {figure.name: figure.values for figure in figures} for seed, figures in by_seed.items()}
    return [
        PaperComparison(
            name,
            figure.unit,
            figure.paper,
            figure.target,
            {seed: values.get(name, ()) for seed, values in of_seed.items()},
        )
        for name, figure in found.items()
    ]
