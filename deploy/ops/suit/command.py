"""`tandem suit check`: what is heard of each node on the bus."""

from __future__ import annotations

import asyncio
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from common.config.load import load_config
from common.errors import TandemError
from deploy.report.options import AsJson, ConfigFile, Overrides
from deploy.report.output import in_a_folder

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
    person: Annotated[
        bool,
        typer.Option(
            "--person", help="Lead the person who wears it through ten poses and motions, two minutes."
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="With --person: new .mcap file to record.", dir_okay=False, callback=in_a_folder),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(help="With --person: judge this recording instead.", dir_okay=False)
    ] = None,
    led: Annotated[
        bool, typer.Option("--led/--not-led", help="Whether that recording begins with the ten steps.")
    ] = True,
    language: Annotated[str, typer.Option(help="Of the steps' texts: en, zh.")] = "en",
    as_json: AsJson = False,
) -> None:
    """Look at the suit's buses and say, node by node, what is right and what is not.

    Turn every node about two of its axes meanwhile: only then can its axes be judged. It ends with status 1
    if anything is wrong.

    With --person a suit is accepted or refused before a trial, by what a body can do: nobody turns faster, no
    gyro disagrees with gravity, neighbours share a joint, left and right do alike what is asked of both.

    Before a trial: `tandem suit check /etc/tandem/operator.toml --person --out suit.mcap`

    Example: `tandem suit check deploy/examples/master.toml --json`
    """
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    if person:
        _check_person(checked, out, recording, led, language, as_json)
        return
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


def _check_person(
    config: MasterConfig, out: Path | None, recording: Path | None, led: bool, language: str, as_json: bool
) -> None:
    from deploy.ops.suit.person import judge_recording, lead_and_record

    if (out is None) == (recording is None):
        raise TandemError("suit check --person: name a new file by --out, or a recording by --recording")
    path = recording or out
    assert path is not None
    if recording is None:
        console = Console(stderr=True)
        asyncio.run(lead_and_record(config, path, language, lambda line: console.print(line, markup=False)))
    judged = judge_recording(path, config, led)
    if as_json:
        typer.echo(json.dumps({"accepted": judged.accepted, **asdict(judged)}, indent=2))
    for axis in () if as_json else judged.not_judged:
        typer.echo(f"{axis}: not judged, as gravity did not turn about this axis of the gyro")
    if not judged.accepted and as_json:
        raise typer.Exit(1)
    if not judged.accepted:
        why = [f"{one.node}: {one.words}" for one in judged.findings]
        if judged.lacking:
            why.append(
                f"not in the recording: {', '.join(judged.lacking)}; where the suit has no such node, say so "
                "in suit.without_node"
            )
        raise TandemError("refused:\n" + "\n".join(why))
    if not as_json:
        typer.echo(f"{path}: accepted")


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
