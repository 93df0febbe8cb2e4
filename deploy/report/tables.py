"""Tables for a terminal, at home in 80 columns, and values as people read them."""

from __future__ import annotations

import math

from rich import box
from rich.table import Table
from rich.text import Text

UNKNOWN = "–"
"""Stands where there is no value."""
GUARD_STYLE = {
    "track": "bold green",
    "align": "bold cyan",
    "hold": "yellow",
    "clutch": "yellow",
    "estop": "bold red",
}


def plain_table(first: str, *others: str, title: str = "") -> Table:
    """An empty table: the first column holds words and folds, the others hold right-aligned numbers."""
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(first, overflow="fold")
    for head in others:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def number(value: float | None, digits: int) -> str:
    """A value with so many decimals; a dash where there is none."""
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def within_limit(value: float | None, limit: float, digits: int) -> Text:
    """A value in green up to its limit, in red above it."""
    if value is None:
        return Text(UNKNOWN)
    return Text(number(value, digits), "green" if value <= limit else "bold red")


def with_unit(value: float | None, unit: str = "") -> str:
    """A value with four digits and its unit; a dash where there is none, `never` where it is infinite."""
    if value is None:
        return UNKNOWN
    return "never" if math.isinf(value) else f"{value:.4g} {unit}".rstrip()
