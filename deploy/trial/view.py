"""What a person sees in the terminal when a trial is over: the setups, the targets, the tasks."""

from __future__ import annotations

from rich.console import Console
from rich.text import Text

from deploy.tables import plain_table
from deploy.trial.figures import BY_NAME, printed
from deploy.trial.report import Findings
from deploy.trial.spread import Row
from deploy.trial.targets import Judged

SHOWN = (
    "one_way_p50_ms",
    "one_way_bound_ms",
    "accepted",
    "rmse_deg",
    "rmse_over_hold",
    "roughness",
    "flow_s",
)


def print_findings(findings: Findings, console: Console) -> None:
    """Medians, then what was to be reached, then what suits which task."""
    heads = [f"{BY_NAME[n].title}{', ' + BY_NAME[n].unit if BY_NAME[n].unit else ''}" for n in SHOWN]
    table = plain_table("network, transport, strategy", *heads)
    for column in table.columns[1:]:
        column.no_wrap = False
    for row in findings.rows:
        table.add_row(f"{row.setup.profile}, {row.setup.name}", *_cells(row))
    console.print(table)
    for judged in findings.judged:
        console.print(_target(judged))
    profile = ""
    for ranking in sorted(findings.rankings, key=lambda r: r.profile):
        if ranking.profile != profile:
            profile = ranking.profile
            console.print(Text(f"\nover {profile}", "bold"))
        console.print(Text.assemble((f"{ranking.task.title}: ", "cyan"), ranking.verdict, "."))


def _cells(row: Row) -> list[Text]:
    if not row.done:
        return [Text("; ".join(row.why_not) or "not run yet", "yellow", overflow="fold")]
    return [Text(printed(name, row.median(name))) for name in SHOWN]


def _target(judged: Judged) -> Text:
    unit = BY_NAME[judged.limit.figure].unit
    words = f"{judged.words}: {judged.worst:.3g} {unit}".rstrip() + f", at most {judged.limit.at_most:g}"
    if judged.met:
        return Text.assemble(("met     ", "green"), words)
    setups = ", ".join(f"{s.profile} {s.name}" for s in judged.missed[:4])
    return Text.assemble(("missed  ", "bold red"), words, (f"  ({setups})", "dim"))
