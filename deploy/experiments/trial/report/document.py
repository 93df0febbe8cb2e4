"""The report for people: one HTML file that opens offline. Pure: the template is filled, nothing is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from deploy.experiments.trial.cell.figures import BY_NAME, FIGURES, CellMetric, printed
from deploy.experiments.trial.report.findings import Findings
from deploy.experiments.trial.report.plots import Plot
from deploy.experiments.trial.report.ranking import Ranking
from deploy.experiments.trial.report.spread import SetupResults, Spread
from deploy.report.page import render

GROUPS = {
    "latency": "One way",
    "trip": "Round trip, age and delivery",
    "motion": "Motion",
    "guard": "Guard",
    "outage": "Outage",
    "cost": "Cost",
}


@dataclass(frozen=True, slots=True)
class MetricTable:
    """The metrics of one group."""

    title: str
    figures: Sequence[CellMetric]
    """Its columns: those that some setup has."""


def as_html(findings: Findings, plots: Sequence[Plot], about: dict[str, str]) -> str:
    """The whole page; texts are escaped by the template."""
    rows = findings.rows
    expected = len(findings.plan.cells())
    finished = sum(cell.settled for row in rows for cell in row.cells)
    return render(
        "deploy.experiments.trial.report",
        "report.html.jinja",
        {"cell": _cell, "spread": _range, "plain": _plain},
        plan=findings.plan,
        about=about,
        rows=rows,
        tables=_tables(rows),
        tasks=_by_task(findings.rankings),
        judged=findings.judged,
        plots=plots,
        incomplete=None if finished >= expected else f"{finished} of {expected} cells are there",
        failed=sum(len(row.failed) for row in rows),
        not_run=[row for row in rows if row.why_not],
        remarks=[(cell.key, remark) for row in rows for cell in row.cells for remark in cell.remarks],
        settings=_settings(rows),
        busy=_busy(rows),
        names=BY_NAME,
    )


def _tables(rows: Sequence[SetupResults]) -> list[MetricTable]:
    measured = {name for row in rows for name in row.spreads}
    tables = []
    for group, title in GROUPS.items():
        figures = [f for f in FIGURES if f.group == group and f.name in measured]
        if figures:
            tables.append(MetricTable(title, figures))
    return tables


def _by_task(ranks: Sequence[Ranking]) -> list[list[Ranking]]:
    """Rankings of one task together, in the tasks' order."""
    names = dict.fromkeys(r.task.name for r in ranks)
    return [[r for r in ranks if r.task.name == name] for name in names]


def _settings(rows: Sequence[SetupResults]) -> dict[str, dict[str, str]]:
    """By network, what was set over the example files."""
    found: dict[str, dict[str, str]] = {}
    for row in rows:
        for cell in row.cells:
            found.setdefault(row.setup.profile, {}).update(cell.settings)
    return {profile: settings for profile, settings in found.items() if settings}


def _busy(rows: Sequence[SetupResults]) -> float | None:
    """The worst share of missed ticks, where it is large enough to distrust the figures."""
    worst = max(
        (row.spreads["ticks_missed"].high for row in rows if "ticks_missed" in row.spreads), default=0.0
    )
    return worst if worst > 2.0 else None


def _cell(row: SetupResults, name: str) -> str:
    return printed(name, row.median(name))


def _range(row: SetupResults, name: str) -> str:
    """The repeats' range, empty where it says no more than the median does."""
    spread: Spread | None = row.spreads.get(name)
    if spread is None or spread.count < 2:
        return ""
    low, high = printed(name, spread.low), printed(name, spread.high)
    return "" if low == high else f"{low} … {high}"


def _plain(value: float) -> str:
    return f"{value:g}"
