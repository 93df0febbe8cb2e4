"""Which setup suits a care task best over a network, and why, in words. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from deploy.experiments.trial.cell.figures import BY_NAME, printed
from deploy.experiments.trial.cell.plan import Setup
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.report.spread import SetupResults, Spread, spread
from deploy.experiments.trial.report.tasks import Criterion, Task

MOST_NAMED = 3
"""Setups in one sentence."""


@dataclass(frozen=True, slots=True)
class Ranked:
    """A setup's place among those over the same network."""

    setup: Setup
    score: Spread | None
    """0 to 100, over the repeats; None where nothing was measured."""
    barred: Sequence[str]
    """Why it is not to be used for the task, whatever its score."""
    figures: str
    """The task's figures, in words."""
    costs: str
    """The value that costs it most points; empty where none does."""

    @property
    def fit(self) -> bool:
        """Whether the setup is ranked."""
        return self.score is not None and not self.barred


@dataclass(frozen=True, slots=True)
class Ranking:
    """All setups over one network, for one task: the fit ones first, the best foremost."""

    task: Task
    profile: str
    places: Sequence[Ranked]

    @property
    def best(self) -> Ranked | None:
        """None where no setup is fit."""
        return self.places[0] if self.places and self.places[0].fit else None

    @property
    def ties(self) -> list[Ranked]:
        """The setups whose score these repeats do not separate from the best."""
        best = self.best
        if best is None or best.score is None:
            return []
        return [r for r in self.places[1:] if r.fit and r.score is not None and r.score.overlaps(best.score)]

    @property
    def verdict(self) -> str:
        """The ranking as one sentence."""
        best = self.best
        if best is None or best.score is None:
            return "no setup is fit"
        words = f"{best.setup.name}: {best.score.median:.0f} of 100 ({best.figures})"
        if best.costs:
            words += f", loses most by {best.costs}"
        if self.ties:
            words += f". These repeats do not separate it from {_listed([t.setup.name for t in self.ties])}"
        if best.score.count < 2:
            words += ". One repeat only: no spread is known"
        return words


def rank(task: Task, profile: str, rows: Sequence[SetupResults]) -> Ranking:
    """Rank the setups over that network. A figure that no setup has (no outage was made) counts for none."""
    ours = [row for row in rows if row.setup.profile == profile]
    used = [c for c in task.criteria if any(c.figure in row.spreads for row in ours)]
    places = sorted((_place(task, used, row) for row in ours), key=_order)
    return Ranking(task, profile, places)


def rankings(tasks: Sequence[Task], rows: Sequence[SetupResults]) -> list[Ranking]:
    """By task, then network, in their own order."""
    profiles = list(dict.fromkeys(row.setup.profile for row in rows))
    return [rank(task, profile, rows) for task in tasks for profile in profiles]


def _place(task: Task, used: Sequence[Criterion], row: SetupResults) -> Ranked:
    scores = spread(_score(used, cell) for cell in row.done)
    barred = [] if row.done else (row.why_not or ["not run yet"])
    for name, most in task.must.items():
        found = row.spreads.get(name)
        if found is not None and found.high > most:
            barred.append(f"{BY_NAME[name].title} {printed(name, found.high)}, may be {most:g}")
    figures = [
        f"{BY_NAME[c.figure].title} {printed(c.figure, row.median(c.figure), unit=True)}" for c in used
    ]
    return Ranked(row.setup, scores, barred, ", ".join(figures), _costs(used, row))


def _score(used: Sequence[Criterion], cell: Cell) -> float | None:
    """What could not be measured where others could scores 0: a robot that was never moved has no error."""
    if not used:
        return None
    points = [(c.weight, _points(c, cell.values.get(c.figure))) for c in used]
    return sum(w * p for w, p in points) / sum(w for w, _ in points)


def _points(criterion: Criterion, value: float | None) -> float:
    return 0.0 if value is None else criterion.score(value)


def _costs(used: Sequence[Criterion], row: SetupResults) -> str:
    lost = [(c.weight * (100.0 - _points(c, row.median(c.figure))), c.figure) for c in used]
    most, name = max(lost, default=(0.0, ""))
    return BY_NAME[name].title if most > 1.0 else ""


def _order(ranked: Ranked) -> tuple[bool, float]:
    return not ranked.fit, -ranked.score.median if ranked.score is not None else 0.0


def _listed(names: Sequence[str]) -> str:
    if len(names) > MOST_NAMED:
        return f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
