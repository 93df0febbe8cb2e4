"""`tandem replay`."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.clock import to_ns
from common.config.load import load_config
from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from common.wire.version import software
from deploy.ops.replay.comparison import ReplayFindings, compare
from deploy.ops.replay.played import PlayedMotion, motion_of
from deploy.recorded.files import begun_ns, entries_of, head_of, snapshot_ns
from deploy.recorded.recompute import Recomputed, Replay
from deploy.recorded.recorded_config import recorded_config
from deploy.report.options import AsJson, Overrides
from deploy.report.tables import plain_table
from master.config import MasterConfig

MOST_JOINTS = 8
"""Rows of the table; --json has all."""


def replay(
    files: Annotated[
        list[Path],
        typer.Argument(help="A recording of `tandem record --tap`, its files in order.", dir_okay=False),
    ],
    config: Annotated[
        Path | None,
        typer.Option(help="Compute with this master's file instead of the recorded one.", dir_okay=False),
    ] = None,
    filter_name: Annotated[
        str | None, typer.Option("--filter", help="Compute with this orientation filter.")
    ] = None,
    overrides: Overrides = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="End with status 1 unless every posture is identical to the last bit."),
    ] = False,
    from_s: Annotated[
        float, typer.Option("--from", help="Begin this many seconds after the recording did.", min=0.0)
    ] = 0.0,
    robot: Annotated[
        Path | None,
        typer.Option(
            help="Play the motion to a simulated robot: the slave's file. Its process is started, engaged.",
            dir_okay=False,
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(help="With --robot: times the recording's own speed.", min=0.1, max=4.0)
    ] = 1.0,
    as_json: AsJson = False,
) -> None:
    """Compute a recording again from the sensors' frames, and compare the joint angles with those recorded.

    With the recorded configuration they are identical to the last bit, whatever second it begins at. With
    --config, --filter or --set the filters learn anew, and the differences are shown by joint.

    --robot plays the motion to a simulated robot, live. Real drives are refused.

    To see what another filter makes of it: `tandem replay morning.mcap --filter ekf`

    To see how a robot would have followed: `tandem replay morning.mcap --robot slave.toml --speed 0.5`

    Example: `tandem replay morning.mcap --check`
    """
    changes = [*(overrides or ()), *([f'estimation.filter="{filter_name}"'] if filter_name else ())]
    with _computed(files, config, changes, from_s) as (run, pairs):
        if robot is not None:
            motion = motion_of(pair.computed for pair in pairs)
        else:
            result = compare(run, pairs)
    if robot is not None:
        _play(motion, robot, speed, as_json=as_json)
        return
    _show(result, files[0], other=config is not None or bool(changes), as_json=as_json)
    if check and not result.whole:
        raise TandemError(f"{files[0]}: {result.postures - result.identical} postures differ")


@contextmanager
def _computed(
    files: Sequence[Path], config: Path | None, changes: Sequence[str], from_s: float
) -> Iterator[tuple[Replay, Iterator[Recomputed]]]:
    """The computation, and its postures beside the recorded ones, while the recorded files are at hand."""
    with ExitStack() as kept:
        if config is not None:
            used = load_config(config, MasterConfig, changes)
        else:
            used = kept.enter_context(recorded_config(head_of(files[0]), files[0].name, changes))
        run = Replay(used, from_snapshots=config is None and not changes)
        kept.enter_context(Console(stderr=True).status("computing"))
        begin_ns = begun_ns(files[0]) + to_ns(from_s)
        pairs = run.pairs(entries_of(files, snapshot_ns(files, begin_ns)))
        yield run, (pair for pair in pairs if pair.recorded.sampled_ns >= begin_ns)


def _show(result: ReplayFindings, file: Path, *, other: bool, as_json: bool) -> None:
    """Print it. Raises TandemError where nothing was computed."""
    if not result.postures:
        raise TandemError(
            f"{file}: nothing could be computed: {result.skipped} postures are recorded, and no snapshot "
            "stands before them; was it recorded by --tap, and for longer than a moment?"
        )
    metadata = head_of(file)
    if as_json:
        typer.echo(json.dumps({**asdict(result), **_versions(metadata), "other": other}, indent=2))
    else:
        _print(result, metadata)


def _versions(metadata: Mapping[str, str]) -> dict[str, str]:
    recorded, now = metadata.get("tandem", "?"), software().tandem
    return {"recorded_by": f"tandem {recorded}", "computed_by": f"tandem {now}"}


def _print(result: ReplayFindings, metadata: Mapping[str, str]) -> None:
    console = Console()
    versions = _versions(metadata)
    console.print(
        f"{result.ticks} ticks, {result.postures} postures: {result.identical} identical to the last bit"
        + (f"; {result.skipped} could not be computed" if result.skipped else "")
        + f" (recorded by {versions['recorded_by']} on {metadata.get('machine', 'an unknown machine')}, "
        f"computed by {versions['computed_by']})",
        highlight=False,
    )
    if result.first is None:
        return
    first = result.first
    console.print(
        f"the first that differs: tick {first.tick}, {first.at_s:.2f} s after the first, "
        f"{first.joint} by {first.apart_deg:.3g}°",
        highlight=False,
    )
    table = plain_table("joint", "RMS °", "most °")
    for name in sorted(result.worst_deg, key=result.worst_deg.__getitem__, reverse=True)[:MOST_JOINTS]:
        table.add_row(name, f"{result.rms_deg[name]:.3g}", f"{result.worst_deg[name]:.3g}")
    console.print(table)


def _play(motion: PlayedMotion, robot: Path, speed: float, *, as_json: bool) -> None:
    from deploy.ops.replay.onto_robot import play, simulated

    simulated(robot)  # said at once
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("starting the robot") as status:
            found = await play(motion, robot, speed, stop, status.update)
        if as_json:
            typer.echo(json.dumps(asdict(found), indent=2))
            return
        worst = sorted(found.rms_deg, key=found.rms_deg.__getitem__, reverse=True)[:MOST_JOINTS]
        typer.echo(
            f"{found.seconds:.1f} s at {speed:g} x: the robot followed {100 * found.followed:.0f} % of it"
        )
        for hold in found.holds:
            typer.echo(f"stopped following: {hold}")
        table = plain_table("joint", "RMS off the recording °")
        for name in worst:
            table.add_row(name, f"{found.rms_deg[name]:.2f}")
        Console().print(table)

    run_until_stopped(work)
