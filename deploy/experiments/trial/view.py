"""What a person sees in the terminal when a trial is over: the setups, the targets, the tasks."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deploy.experiments.trial.cell.figures import BY_NAME, printed
from deploy.experiments.trial.report.findings import Findings
from deploy.experiments.trial.report.spread import SetupResults
from deploy.measure.verdict import verdict_table
from deploy.report.tables import plain_table

SHOWN = ("one_way_p50_ms", "one_way_bound_ms", "rmse_deg", "rmse_over_latest", "roughness", "flow_s")


def print_findings(findings: Findings, console: Console) -> None:
    """Medians, then what was to be reached, then what suits which task."""
    console.print(_table(findings.rows))
    for row in findings.rows:
        if not row.done:
            why = "; ".join(row.why_not) or "not run yet"
            console.print(Text.assemble((f"{row.setup.profile}, {row.setup.name}: ", "dim"), (why, "yellow")))
    failed = sum(len(row.failed) for row in findings.rows)
    if failed:
        console.print(Text(f"{failed} failed: ran without a result", "bold red"))
    if findings.judged:
        console.print(verdict_table("targets", findings.judged))
    profile = ""
    for ranking in sorted(findings.rankings, key=lambda r: r.profile):
        if ranking.profile != profile:
            profile = ranking.profile
            console.print(Text(f"\nover {profile}", "bold"))
        console.print(Text.assemble((f"{ranking.task.title}: ", "cyan"), ranking.verdict, "."))


def _table(rows: Iterable[SetupResults]) -> Table:
    """A section a network; at home in 80 columns."""
    heads = [f"{BY_NAME[n].title}{', ' + BY_NAME[n].unit if BY_NAME[n].unit else ''}" for n in SHOWN]
    table = plain_table("", *heads)
    table.columns[0].no_wrap = True
    for column in table.columns[1:]:
        column.no_wrap = False
    profile = ""
    for row in rows:
        if row.setup.profile != profile:
            profile = row.setup.profile
            table.add_section()
            table.add_row(Text(profile, "bold"))
        table.add_row(
            f"  {row.setup.transport} {row.setup.strategy}",
            *(printed(name, row.median(name)) for name in SHOWN),
        )
    return table
