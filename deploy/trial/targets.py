"""The figures a trial is to reach, as data, and whether this one did. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from deploy.trial.figures import BY_NAME
from deploy.trial.plan import Setup
from deploy.trial.spread import Row


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
    """None where nothing was measured."""
    worst_setup: Setup | None
    missed: Sequence[Setup]
    asked: int
    """Of how many setups."""

    @property
    def met(self) -> bool | None:
        """None where there is nothing to judge."""
        return None if self.worst is None else not self.missed

    @property
    def words(self) -> str:
        """What was asked of which setups."""
        where = f" under {self.limit.profile}" if self.limit.profile else ""
        who = f", {self.limit.strategy}{where}" if self.limit.strategy else where
        return f"{BY_NAME[self.limit.figure].title}{who}"


def judge(rows: Sequence[Row], limits: Sequence[Limit] = LIMITS) -> list[Judged]:
    """Those that this trial has setups for."""
    return [judged for limit in limits if (judged := _judge(limit, rows)) is not None]


def _judge(limit: Limit, rows: Sequence[Row]) -> Judged | None:
    found = [
        (spread.high if limit.each else spread.median, row.setup)
        for row in rows
        if limit.strategy in (None, row.setup.strategy)
        and limit.profile in (None, row.setup.profile)
        and (spread := row.spreads.get(limit.figure)) is not None
    ]
    if not found:
        return None
    worst, setup = max(found, key=lambda item: item[0])
    missed = [s for value, s in found if value > limit.at_most]
    return Judged(limit, worst, setup, missed, len(found))
