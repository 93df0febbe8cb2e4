"""The experiments' figures for people and for machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from deploy.experiments.accuracy.papers.figures import Experiment, Row
from deploy.measure.tables import UNKNOWN
from deploy.measure.verdict import STYLES


def experiment_table(experiment: Experiment, rows: Sequence[Row]) -> RenderableType:
    """One experiment: the paper's figure beside ours, mean and worst over seeds, and the target."""
    table = Table(
        title=f"{experiment.key}  {experiment.title}",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("", overflow="fold")
    for head in ("paper", "mean", "worst", "at most", ""):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            f"{row.name}, {row.unit}" if row.unit else row.name,
            *(_number(x) for x in (row.paper, row.mean, row.worst, row.target)),
            "" if row.outcome is None else Text(row.outcome, STYLES[row.outcome]),
        )
    return Group(table, *(Text(note, "dim") for note in experiment.notes))


def experiment_tree(experiment: Experiment, rows: Sequence[Row]) -> dict[str, Any]:
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
