"""`tandem suit check`: what is heard of each node on the bus."""

from __future__ import annotations

import asyncio
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from common.config.load import load_config
from common.errors import TandemError
from deploy.report.options import AsJson, ConfigFile, Overrides

if TYPE_CHECKING:
    from deploy.ops.suit.conformance import RuleVerdict
    from deploy.ops.suit.examine import NodeFinding
    from master.config import MasterConfig


def check(
    config: ConfigFile,
    set_: Overrides = None,
    seconds: Annotated[float, typer.Option(help="How long to listen.", min=1.0, max=600.0)] = 10.0,
    conformance: Annotated[
        bool,
        typer.Option(
            "--conformance", help="Test the nodes against docs/suit-protocol.md; stop the master first."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Look at the suit's buses and say, node by node, what is right and what is not.

    Turn every node about two of its axes meanwhile: only then can its axes be judged. It ends with status 1
    if anything is wrong.

    Example: `tandem suit check deploy/examples/master.toml --json`
    """
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    if conformance:
        from deploy.ops.suit.ask import ask

        _report_conformance(asyncio.run(ask(checked)), as_json)
        return
    from deploy.ops.suit.listen import listen

    findings = asyncio.run(listen(checked, seconds))
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        Console().print(as_table(findings, checked))
    wrong = [f"{f.name}: {trouble}" for f in findings for trouble in f.troubles]
    if wrong and as_json:
        raise typer.Exit(1)
    if wrong:
        raise TandemError("\n".join(wrong))


def as_table(findings: list[NodeFinding], config: MasterConfig) -> Table:
    """A row a node."""
    table = Table("node", "rate", "jitter", "lost", "gravity", "motion", "axes", title="suit check")
    for finding in findings:
        table.add_row(
            finding.name,
            f"{finding.rate_hz:.0f} Hz",
            "-" if finding.jitter_ms is None else f"{finding.jitter_ms:.2f} ms",
            f"{100.0 * finding.lost_share:.1f} %",
            "-" if finding.gravity_m_s2 is None else f"{finding.gravity_m_s2:.2f} m/s²",
            finding.motion,
            finding.axes,
        )
    for segment, word in config.suit.without_node.items():
        table.add_row(segment, "-", "-", "-", "-", f"no node: {word}", "-")
    return table


def _report_conformance(verdicts: list[RuleVerdict], as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps([asdict(verdict) for verdict in verdicts], indent=2))
    else:
        table = Table("node", "rule", "held", "seen", title="docs/suit-protocol.md")
        for verdict in verdicts:
            table.add_row(verdict.node, verdict.rule, "yes" if verdict.held else "NO", verdict.seen)
        Console().print(table)
    broken = [f"{v.node}: {v.rule}: {v.seen}" for v in verdicts if not v.held]
    if broken and as_json:
        raise typer.Exit(1)
    if broken:
        raise TandemError("\n".join(broken))
