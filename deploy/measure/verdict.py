"""The one verdict of tandem: what was asked, what was measured, the limit, and the outcome."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.report.tables import plain_table, with_unit


class Outcome(StrEnum):
    """Whether the requirement is kept. What was not measured is never called passed."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True, slots=True)
class Verdict:
    """One requirement, judged."""

    name: str
    """What is asked, such as `motion lag`."""
    outcome: Outcome
    measured: float | None = None
    """None where nothing could be measured; infinite where what should have come never came."""
    limit: float | None = None
    """The most it may be."""
    unit: str = ""
    why: str = ""
    """Where the measured value comes from, or why there is none."""
    group: str = ""

    @property
    def passed(self) -> bool | None:
        """None where it was not judged."""
        return None if self.outcome is Outcome.NOT_JUDGED else self.outcome is Outcome.PASSED

    def tree(self) -> dict[str, str | float | None]:
        """The JSON object of a report."""
        measured = None if self.measured is None or math.isinf(self.measured) else self.measured
        return {**asdict(self), "outcome": str(self.outcome), "measured": measured}


def at_most(
    name: str, measured: float | None, limit: float, unit: str = "", *, why: str = "", group: str = ""
) -> Verdict:
    """Passed up to the limit, the limit included; not judged where nothing was measured."""
    if measured is None:
        outcome = Outcome.NOT_JUDGED
    else:
        outcome = Outcome.PASSED if measured <= limit else Outcome.FAILED
    return Verdict(name, outcome, measured, limit, unit, why, group)


def unproven(verdict: Verdict, why: str, measured: float | None) -> Verdict:
    """The verdict, not judged instead of passed: too little was looked at. A failure stays one."""
    if verdict.outcome is not Outcome.PASSED:
        return verdict
    why = f"{why}; {verdict.why}" if verdict.why else why
    return replace(verdict, outcome=Outcome.NOT_JUDGED, why=why, measured=measured)


def failed(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """The verdicts that failed."""
    return [verdict for verdict in verdicts if verdict.outcome is Outcome.FAILED]


def counts(verdicts: Iterable[Verdict]) -> str:
    """How many there are of each outcome, such as `3 passed, 0 failed, 1 not judged`."""
    outcomes = [verdict.outcome for verdict in verdicts]
    return ", ".join(f"{outcomes.count(outcome)} {outcome}" for outcome in Outcome)


STYLES = {Outcome.PASSED: "green", Outcome.FAILED: "bold red", Outcome.NOT_JUDGED: "yellow"}


def verdict_table(title: str, verdicts: Iterable[Verdict]) -> RenderableType:
    """A row for each verdict, grouped; below it those that were not judged, by their reason."""
    verdicts = list(verdicts)
    reasons = any(v.why for v in verdicts if v.outcome is not Outcome.NOT_JUDGED)
    table = plain_table(title or "criterion", "measured", "at most", "", *[""] * reasons)
    if reasons:
        table.columns[-1].justify, table.columns[-1].no_wrap = "left", False
    group = ""
    not_judged: dict[str, list[str]] = {}
    for v in verdicts:
        if v.outcome is Outcome.NOT_JUDGED:
            not_judged.setdefault(v.why, []).append(v.name)
            continue
        if v.group != group:
            group = v.group
            table.add_section()
        table.add_row(
            Text.assemble((f"{v.group}: ", "dim"), v.name) if v.group else v.name,
            with_unit(v.measured, v.unit),
            with_unit(v.limit, v.unit),
            Text(v.outcome, STYLES[v.outcome]),
            *([Text(v.why, "dim")] if reasons else []),
        )
    style = STYLES[Outcome.NOT_JUDGED]
    return Group(
        table,
        *(
            Text.assemble(
                ("not judged: ", style), "; ".join(names), (f" ({why or 'nothing was measured'})", "dim")
            )
            for why, names in not_judged.items()
        ),
    )
