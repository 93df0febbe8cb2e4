"""The experiments' figures for people and for machines."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.experiments.accuracy.papers.figures import Experiment, PaperComparison
from deploy.measure.verdict import STYLES
from deploy.report.tables import UNKNOWN, plain_table


def experiment_table(experiment: Experiment, rows: Sequence[PaperComparison]) -> RenderableType:
    """One experiment: the paper's figure beside ours, mean and worst over seeds, and the target."""
    heads = ("paper", "mean", "worst", "at most", "")
    table = plain_table("", *heads, title=f"{experiment.key}  {experiment.title}")
    for row in rows:
        table.add_row(
            f"{row.name}, {row.unit}" if row.unit else row.name,
            *(_number(x) for x in (row.paper, row.mean, row.worst, row.target)),
            "" if row.outcome is None else Text(row.outcome, STYLES[row.outcome]),
        )
    return Group(table, *(Text(note, "dim") for note in experiment.notes))


def experiment_tree(experiment: Experiment, rows: Sequence[PaperComparison]) -> dict[str, object]:
    """The same for a report."""
    return {
        "title": experiment.title,
        "notes": list(experiment.notes),
        "figures": [
            {
                "name": row.name,
                "unit": row.unit,
                "paper": row.paper,
                "target": row.target,
                "mean": row.mean,
                "worst": row.worst,
                "outcome": row.outcome,
                "by_seed": {str(seed): list(values) for seed, values in row.by_seed.items()},
            }
            for row in rows
        ],
    }


def _number(value: float | None) -> str:
    return UNKNOWN if value is None else f"{value:.3g}"
