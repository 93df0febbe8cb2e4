"""The proof's table in a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.measure.proof import ProofRow
from deploy.report.tables import UNKNOWN, number, plain_table


def proof_table(rows: Sequence[ProofRow]) -> RenderableType:
    """A row a figure, then in words what could not be said and which stamps are wrong."""
    table = plain_table("", "found ms", "± ms", "claimed ms", title="motion to motion")
    for row in rows:
        table.add_row(
            Text(row.name, "bold red" if row.wrong else ""),
            number(row.found_ms, 1),
            number(row.bound_ms, 1),
            UNKNOWN if row.claimed_ms is None else number(row.claimed_ms, 1),
        )
    words = [Text(f"{row.name}: {row.why}", "bold red" if row.wrong else "yellow") for row in rows if row.why]
    return Group(table, *words)
