"""The figures a trial is to reach, as data, and whether this one did. Pure."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from deploy.experiments.trial.cell.figures import BY_NAME, FIGURES, OUTAGE
from deploy.experiments.trial.cell.plan import Setup
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.report.spread import Row


@dataclass(frozen=True, slots=True)
class Limit:
    """The most a figure may be, in the median of a setup's repeats."""

    figure: str
    at_most: float
    strategy: str | None = None
    """Of which setups; None: of all."""
    profile: str | None = None
    each: bool = False
    """Every single repeat must keep it: what endangers a person has no median."""


LIMITS = (
    Limit("rmse_over_hold", 0.4, "predict", "4g"),
    Limit("roughness", 3.0, "predict", "4g"),
    Limit("rmse_over_hold", 0.5, "predict", "intercontinental"),
    Limit("roughness", 3.0, "predict", "intercontinental"),
    Limit("flow_s", 1.5),
    Limit("stale_accepted", 0, each=True),
    Limit("moved_alone", 0, each=True),
)


@dataclass(frozen=True, slots=True)
class Judged:
    """A limit, and the setups it is asked of."""

    limit: Limit
    worst: float | None
    """None where every repeat failed; infinite where what should have come never did."""
    worst_setup: Setup | None
    missed: Sequence[Setup]
    asked: int
    """Of how many setups."""
    failed: int = 0
    """Repeats that were run and came to nothing: what they would have shown is not known."""

    @property
    def met(self) -> bool:
        """Whether every setup kept it, and every repeat that was asked told of it."""
        return not self.missed and not self.failed

    @property
    def measured(self) -> str:
        """The worst, as people read it."""
        if self.worst is None:
            return "nothing"
        if math.isinf(self.worst):
            return "never"
        return f"{self.worst:.3g} {BY_NAME[self.limit.figure].unit}".rstrip()

    @property
    def words(self) -> str:
        """What was asked of which setups."""
        where = f" under {self.limit.profile}" if self.limit.profile else ""
        who = f", {self.limit.strategy}{where}" if self.limit.strategy else where
        return f"{BY_NAME[self.limit.figure].title}{who}"


def judge(rows: Sequence[Row], limits: Sequence[Limit] = LIMITS, outage: bool = True) -> list[Judged]:
    """Those that this trial has setups for; `outage` where each cell was to have one."""
    asked = [limit for limit in limits if outage or BY_NAME[limit.figure].group != OUTAGE]
    return [judged for limit in asked if (judged := _judge(limit, rows)) is not None]


def _judge(limit: Limit, rows: Sequence[Row]) -> Judged | None:
    asked = [
        row
        for row in rows
        if limit.strategy in (None, row.setup.strategy) and limit.profile in (None, row.setup.profile)
    ]
    found = [
        (max(values) if limit.each else statistics.median(values), row.setup)
        for row in asked
        if (values := [_value(limit, cell) for cell in row.done if _is_asked(limit, cell)])
    ]
    failed = sum(len(row.failed) for row in asked)
    if not found:
        return Judged(limit, None, None, (), 0, failed) if failed else None
    worst, setup = max(found, key=lambda item: item[0])
    missed = [s for value, s in found if value > limit.at_most]
    return Judged(limit, worst, setup, missed, len(found), failed)


def _is_asked(limit: Limit, cell: Cell) -> bool:
    """Whether the cell should have the figure: those of an outage only where one was made."""
    if BY_NAME[limit.figure].group != OUTAGE:
        return True
    return any(cell.values.get(figure.name) is not None for figure in FIGURES if figure.group == OUTAGE)


def _value(limit: Limit, cell: Cell) -> float:
    """A figure that should be there and is not misses every limit: commands that never flowed again."""
    value = cell.values.get(limit.figure)
    return math.inf if value is None else value
