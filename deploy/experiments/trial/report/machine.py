"""The report for machines: JSON whose compared part differs only where the findings do, and CSV. Pure."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import asdict

from deploy.experiments.trial.cell.figures import BY_NAME, FIGURES, rounded
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.report.findings import Findings
from deploy.experiments.trial.report.ranking import Ranking
from deploy.experiments.trial.report.spread import SetupResults, Spread

_KEYS = ("profile", "transport", "strategy", "repetition", "status")


def tree(findings: Findings, about: dict[str, str]) -> dict[str, object]:
    """`compared` holds no time, host or version: those are in `about`. Figures are rounded as printed."""
    return {
        "about": about,
        "compared": {
            "plan": findings.plan.tree(),
            "setups": {_path(row): _setup(row) for row in findings.rows},
            "rankings": [_ranking(ranking) for ranking in findings.rankings],
            "targets": [verdict.tree() for verdict in findings.judged],
        },
    }


def as_csv(cells: Iterable[Cell]) -> str:
    """A line a cell, the figures' names with their units in the head; empty where it was not measured."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    heads = [f"{f.name} [{f.unit}]" if f.unit in ("%", "kB/s") else f.name for f in FIGURES]
    writer.writerow([*_KEYS, *heads, "why"])
    for cell in sorted(cells, key=lambda c: (c.key.setup.profile, c.key.slug)):
        setup, values = cell.key.setup, rounded(cell.values)
        writer.writerow(
            [setup.profile, setup.transport, setup.strategy, cell.key.repetition, str(cell.status)]
            + ["" if value is None else value for value in values.values()]
            + [cell.why]
        )
    return out.getvalue()


def _path(row: SetupResults) -> str:
    return f"{row.setup.profile}/{row.setup.transport}/{row.setup.strategy}"


def _setup(row: SetupResults) -> dict[str, object]:
    return {
        "repeats_done": len(row.done),
        "repeats_failed": len(row.failed),
        "why_not": row.why_not,
        "figures": {name: _spread(name, spread) for name, spread in row.spreads.items()},
        "remarks": [f"repeat {c.key.repetition}: {remark}" for c in row.cells for remark in c.remarks],
    }


def _spread(name: str, spread: Spread) -> dict[str, float]:
    digits = BY_NAME[name].digits
    return {key: round(value, digits) + 0.0 for key, value in asdict(spread).items()}


def _ranking(ranking: Ranking) -> dict[str, object]:
    return {
        "task": ranking.task.name,
        "profile": ranking.profile,
        "verdict": ranking.verdict,
        "places": [
            {
                "setup": place.setup.name,
                "score": None if place.score is None else round(place.score.median, 1),
                "barred": list(place.barred),
            }
            for place in ranking.places
        ],
    }
