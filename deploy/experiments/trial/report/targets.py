"""The limits that a trial is held to, as data, and its verdicts. Pure."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from deploy.experiments.trial.cell.figures import BY_NAME, FIGURES, OUTAGE
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.report.spread import SetupResults
from deploy.measure.verdict import Outcome, Verdict

MOST_NAMED = 4
"""Setups that a verdict names."""


@dataclass(frozen=True, slots=True)
class SetupLimit:
    """The most that a value may be, in the median of a setup's repeats."""

    figure: str
    at_most: float
    strategy: str | None = None
    """Of which setups; None: of all."""
    profile: str | None = None
    each: bool = False
    """Every single repeat must keep it: what endangers a person has no median."""

    where_known: bool = False
    """A cell without the value is not asked: in it the robot was not moving."""

    @property
    def words(self) -> str:
        """What is asked of which setups."""
        where = f" under {self.profile}" if self.profile else ""
        setups = f", {self.strategy}{where}" if self.strategy else where
        return f"{BY_NAME[self.figure].title}{setups}"

    @property
    def of_outage(self) -> bool:
        """Whether only a cell with an outage can keep or break it."""
        return BY_NAME[self.figure].group == OUTAGE


LIMITS = (
    SetupLimit("rmse_over_latest", 0.4, "predict", "4g"),
    SetupLimit("roughness", 3.0, "predict", "4g"),
    SetupLimit("rmse_over_latest", 0.5, "predict", "intercontinental"),
    SetupLimit("roughness", 3.0, "predict", "intercontinental"),
    SetupLimit("flow_s", 1.5),
    SetupLimit("stale_accepted", 0, each=True),
    SetupLimit("moved_alone", 0, each=True),
    SetupLimit("blind_excess_cm", 0, each=True, where_known=True),
)


def judge(
    rows: Sequence[SetupResults], limits: Sequence[SetupLimit] = LIMITS, outage: bool = True
) -> list[Verdict]:
    """A verdict for each limit that this trial has setups for; `outage`: whether its cells have an outage."""
    asked = [limit for limit in limits if outage or not limit.of_outage]
    return [verdict for limit in asked if (verdict := _judge(limit, rows)) is not None]


def _judge(limit: SetupLimit, rows: Sequence[SetupResults]) -> Verdict | None:
    """Passed where every setup keeps the limit and no repeat failed; None where it is asked of no setup."""
    asked = [
        row
        for row in rows
        if limit.strategy in (None, row.setup.strategy) and limit.profile in (None, row.setup.profile)
    ]
    found = [
        (
            max(values) if limit.each else statistics.median(values),
            f"{row.setup.name} over {row.setup.profile}",
        )
        for row in asked
        if (values := [_value(limit, cell) for cell in row.done if _is_asked(limit, cell)])
    ]
    failed = sum(len(row.failed) for row in asked)
    if not found and not failed:
        return None
    worst, setup = max(found, default=(None, ""), key=lambda item: item[0])
    missed = [name for value, name in found if value > limit.at_most]
    reasons = [f"worst: {setup}"] if found and not missed else []
    if missed:
        more = ", …" if len(missed) > MOST_NAMED else ""
        reasons.append(f"{len(missed)} of {len(found)} setups: {', '.join(missed[:MOST_NAMED])}{more}")
    if failed:
        reasons.append(f"{failed} failed")
    return Verdict(
        limit.words,
        Outcome.FAILED if missed or failed else Outcome.PASSED,
        worst,
        limit.at_most,
        BY_NAME[limit.figure].unit,
        "; ".join(reasons),
    )


def _is_asked(limit: SetupLimit, cell: Cell) -> bool:
    """Whether the cell should have the value: those of an outage only where one was made."""
    if limit.where_known and cell.values.get(limit.figure) is None:
        return False
    return not limit.of_outage or any(
        cell.values.get(f.name) is not None for f in FIGURES if f.group == OUTAGE
    )


def _value(limit: SetupLimit, cell: Cell) -> float:
    """A value that should be there and is not breaks every limit: commands that never flowed again."""
    value = cell.values.get(limit.figure)
    return math.inf if value is None else value
