"""`tandem inspect`."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from deploy.report.options import AsJson
from deploy.report.output import in_a_folder

if TYPE_CHECKING:
    from common.recording import ChainCheck
    from deploy.measure.ahead import AheadScore
    from deploy.ops.inspect.findings import FileFindings
    from deploy.ops.inspect.jitter.judge import JitterFindings

LONGEST_SHOWN = 300
"""Characters of a file's head: a whole configuration is for programs, by --json."""
EVENTS_SHOWN = 40
DEFAULT_S = 60.0


def inspect(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="An .mcap file that `tandem record` wrote; with --jitter also the other side's.",
            dir_okay=False,
        ),
    ],
    jitter: Annotated[
        bool, typer.Option("--jitter", help="Name the stage of the way at which jitter begins.")
    ] = False,
    plots: Annotated[
        Path | None, typer.Option(help="Draw pictures into this folder.", callback=in_a_folder)
    ] = None,
    profile: Annotated[
        str | None, typer.Option(help="The robot's profile; by default the recording says it, else nursing.")
    ] = None,
    from_s: Annotated[
        float | None,
        typer.Option(
            "--from", help="Judge jitter from this second on; by default once the robot follows.", min=0.0
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Judge jitter over at most this time.", min=5.0, max=600.0)
    ] = DEFAULT_S,
    as_json: AsJson = False,
) -> None:
    """Show what is in a recording: topics, rates, silences, what is missing, versions, what the guard did.

    Each change of the guard is shown with the commands before it and the joint that was furthest off its
    setpoint. --plots draws the joints and the seconds around each change.

    To find out where a shaking arm shakes first: `tandem inspect master.mcap slave.mcap --jitter`

    Example: `tandem inspect morning.mcap --plots morning`
    """
    from deploy.ops.inspect.findings import look_into
    from deploy.ops.inspect.jitter.stages import Stretch, jitter_of
    from deploy.ops.inspect.pictures import draw_jitter, make_folder

    found, skeleton = look_into(files, profile, plots)
    judged = None
    if jitter:
        begin_s = found[0].follows_s if from_s is None else from_s
        judged, signals = jitter_of(files, skeleton, Stretch(begin_s, seconds))
        if plots is not None:
            make_folder(plots)
            draw_jitter(plots / "jitter.png", judged, signals)
    if as_json:
        tree: dict[str, object] = {"files": [one.tree() for one in found[1:]], **found[0].tree()}
        if judged is not None:
            first = None if judged.first is None else judged.first.stage
            tree["jitter"] = {**asdict(judged), "words": judged.words, "first": first}
        typer.echo(json.dumps(tree, indent=2, ensure_ascii=False))
        return
    console = Console()
    for one in found:
        _print(console, one)
    if judged is not None:
        _print_jitter(console, judged)


def _print(console: Console, found: FileFindings) -> None:
    from deploy.report.tables import UNKNOWN, plain_table

    contents = found.contents
    table = plain_table(
        "topic", "messages", "rate Hz", "MB", "longest silence s", "missing", title=found.path.name
    )
    for name, topic in contents.topics.items():
        missing = UNKNOWN if topic.missing is None else str(topic.missing)
        size, gap = f"{topic.size / 1e6:.2f}", f"{topic.longest_gap_s:.2f}"
        table.add_row(name, str(topic.count), f"{topic.rate_hz:.1f}", size, gap, missing)
    console.print(table)
    console.print(f"{found.span_s:.1f} s", highlight=False)
    for key, value in contents.metadata.items():
        shown = value if len(value) <= LONGEST_SHOWN else f"{len(value)} characters"
        console.print(f"{key}: {shown}", highlight=False, markup=False)
    if contents.cut:
        console.print(f"[yellow]{contents.cut}: only the part before it is shown", highlight=False)
    console.print(_chain_words(found.chain), highlight=False, markup=False)
    if found.unread:
        console.print(found.unread, style="yellow", highlight=False, markup=False)
    if found.limited_s:
        held = ", ".join(f"{joint} {seconds:.1f} s" for joint, seconds in found.limited_s.items())
        console.print(f"held back by a limit: {held}", highlight=False)
    for robot, score in found.foretold.items():
        console.print(_foretold_words(robot, score), highlight=False, markup=False)
    if not found.events:
        return
    table = plain_table(
        "what the guard did", "s", "commands before", "silence s", "furthest off", title="guard"
    )
    several = len({event.robot for event in found.events}) > 1
    for event in found.events[:EVENTS_SHOWN]:
        off = f"{event.off_joint} {event.off_deg:.2f}°" if event.off_joint else UNKNOWN
        words = f"{event.state}: {event.reason}" if event.reason else event.state
        words = f"{event.robot}: {words}" if several else words
        silence = f"{event.silence_s:.2f}" if event.commands else UNKNOWN
        table.add_row(words, f"{event.at_s:.1f}", str(event.commands), silence, off)
    console.print(table)
    rest = len(found.events) - EVENTS_SHOWN + found.more_events
    if rest > 0:
        console.print(f"and {rest} more; --json has them", highlight=False)


def _foretold_words(robot: str, score: AheadScore) -> str:
    return (
        f"{robot or 'robot'}: foretold {score.ahead_ms:.0f} ms ahead, off by {score.rms_deg:.2f}° RMS "
        f"(the newest state as it is: {score.held_rms_deg:.2f}°), {score.inside_percent:.0f} % within its "
        f"tube ({score.count} readings)"
    )


def _chain_words(chain: ChainCheck) -> str:
    if not chain.links:
        return "no chain of hashes: it was recorded by an earlier version, or changed"
    kept = f"chain of hashes: {chain.links} links, bytes 0 to {chain.sealed - 1} of {chain.size}"
    broken = f"; {chain.broken.upper()}" if chain.broken else ""
    return f"{kept} as they were written, head {chain.head[:16]}…{broken}"


def _print_jitter(console: Console, judged: JitterFindings) -> None:
    from deploy.report.tables import plain_table

    table = plain_table(
        "stage", "sampled Hz", "< 3 Hz", "3–15 Hz", "> 15 Hz", "jump",
        title=f"angular velocity by band, RMS in °/s, {judged.from_s:.1f} to {judged.until_s:.1f} s",
    )  # fmt: skip
    for stage in judged.stages:
        low, jitter, high = (f"{math.degrees(v):.3g}" for v in stage.velocity_rad_s)
        cells = (f"{stage.rate_hz:.1f}", low, jitter, high, f"{stage.jump:.2f}")
        table.add_row(stage.stage, *cells, style="bold red" if stage is judged.first else None)
    console.print(table)
    console.print(judged.words, highlight=False)
