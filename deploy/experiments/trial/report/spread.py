"""Repeats of one setup into a median and a spread. Pure."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from deploy.experiments.trial.cell.figures import FIGURES
from deploy.experiments.trial.cell.plan import Setup, TrialPlan
from deploy.experiments.trial.cell.result import Cell, CellStatus


@dataclass(frozen=True, slots=True)
class Spread:
    """One value over the repeats that measured it: median and range, as there are only a few."""

    median: float
    low: float
    high: float
    count: int

    def overlaps(self, other: Spread) -> bool:
        """Whether the two ranges overlap, so that the value does not separate the two setups."""
        return self.low <= other.high and other.low <= self.high


@dataclass(frozen=True, slots=True)
class SetupResults:
    """A setup over its repeats."""

    setup: Setup
    cells: Sequence[Cell]
    """The cells that exist, in the order of their repetitions."""
    spreads: Mapping[str, Spread]
    """By name; missing where no repeat measured it."""

    @property
    def done(self) -> Sequence[Cell]:
        """The cells with a result."""
        return [cell for cell in self.cells if cell.status is CellStatus.DONE]

    @property
    def failed(self) -> Sequence[Cell]:
        """The cells that ran without a result."""
        return [cell for cell in self.cells if cell.status is CellStatus.FAILED]

    @property
    def why_not(self) -> list[str]:
        """Why repeats are missing, each reason once."""
        return list(dict.fromkeys(cell.why for cell in self.cells if cell.status is not CellStatus.DONE))

    def median(self, name: str) -> float | None:
        """The median of one value."""
        spread = self.spreads.get(name)
        return None if spread is None else spread.median


def spread(values: Iterable[float | None]) -> Spread | None:
    """None where no value is known."""
    known = [value for value in values if value is not None]
    return Spread(statistics.median(known), min(known), max(known), len(known)) if known else None


def rows(plan: TrialPlan, cells: Iterable[Cell]) -> list[SetupResults]:
    """A row a setup of the plan, in its order."""
    by_setup: dict[Setup, list[Cell]] = {setup: [] for setup in plan.setups()}
    for cell in sorted(cells, key=lambda c: c.key.repetition):
        if cell.key.setup in by_setup:
            by_setup[cell.key.setup].append(cell)
    return [_row(setup, group) for setup, group in by_setup.items()]


def _row(setup: Setup, cells: Sequence[Cell]) -> SetupResults:
    done = [cell for cell in cells if cell.status is CellStatus.DONE]
    found = {f.name: spread(cell.values.get(f.name) for cell in done) for f in FIGURES}
    return SetupResults(setup, cells, {name: s for name, s in found.items() if s is not None})
