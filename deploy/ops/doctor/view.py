"""The report: a table for people, a tree for machines."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from deploy.ops.doctor.judge.finding import Finding, Health, worst

_STYLE = {Health.OK: "green", Health.WARN: "yellow", Health.FAIL: "bold red"}


def as_table(findings: Sequence[Finding]) -> Table:
    """One row a finding; what to do stands below what was found."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("check", overflow="fold")
    table.add_column("", no_wrap=True)
    table.add_column("found, and what to do", overflow="fold")
    for finding in findings:
        style = _STYLE[finding.health]
        words = Text(finding.found)
        if finding.advice:
            words.append(f"\n→ {finding.advice}", "dim" if finding.health is Health.OK else style)
        table.add_row(Text(finding.check), Text(finding.health, style), words)
    return table


def as_tree(role: str, findings: Sequence[Finding]) -> dict[str, object]:
    """Plain JSON values."""
    return {
        "role": role,
        "health": str(worst(findings)),
        "checks": [
            {"check": f.check, "health": str(f.health), "found": f.found, "do": f.advice or None}
            for f in findings
        ],
    }


def in_words(role: str, findings: Sequence[Finding]) -> str:
    """The end of the report, one line."""
    counts = {health: sum(f.health is health for f in findings) for health in Health}
    worse = [f"{counts[h]} {h}" for h in (Health.FAIL, Health.WARN) if counts[h]]
    return f"{role}: {', '.join([*worse, f'{counts[Health.OK]} ok'])}"
