"""The table of a fleet's bench."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.experiments.bench.fleet.run import FleetReport, watching
from deploy.measure.verdict import verdict_table
from deploy.report.tables import plain_table


def fleet_table(report: FleetReport) -> RenderableType:
    """One line a fleet: what it costs its operator's host, the router and the robots' host."""
    table = plain_table(
        "fleet", "master", "least–most", "MB", "in/s", "out/s", "router", "robots",
        title="percent of one core, by CPU time",
    )  # fmt: skip
    for cell in report.cells:
        runs = f"{min(cell.core_percent_runs):.2f}–{max(cell.core_percent_runs):.2f}"
        table.add_row(
            Text(cell.cell.name, "" if cell.measured else "bold red"), f"{cell.core_percent:.2f}", runs,
            f"{cell.rss_mb:.0f}", f"{cell.states_hz + cell.summaries_hz:.0f}", f"{cell.commands_hz:.0f}",
            f"{cell.router_percent:.1f}", f"{cell.robots_percent:.1f}",
        )  # fmt: skip
    line = watching(report.cells)
    if line is not None:
        words = f"watching N robots costs {line.fixed_percent:.2f} % + {line.each_percent:.4f} % × N"
        return Group(table, words, verdict_table("is the fleet cheap enough?", report.verdicts))
    return Group(table, verdict_table("is the fleet cheap enough?", report.verdicts))
