"""`tandem import`: recordings of any known format into tandem's own files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.report.options import AsJson
from deploy.report.output import in_a_folder
from deploy.report.tables import number, plain_table

if TYPE_CHECKING:
    from common.recording.formats.registry import ReadNodes
    from common.recording.formats.samples import ReadOptions
    from common.recording.node import NodeRecording
    from deploy.ops.convert.judge import ImportJudgement


class Target(StrEnum):
    """What is written."""

    NPZ = "npz"
    MCAP = "mcap"


def import_recording(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Recordings, or folders of x-IMU3 or ROS 2. Files of one node are joined.",
        ),
    ],
    to: Annotated[
        Target, typer.Option(help="npz keeps orientations; mcap is a suit's recording.")
    ] = Target.NPZ,
    out: Annotated[
        Path | None,
        typer.Option(
            help="New file; by default the first FILE's name.", dir_okay=False, callback=in_a_folder
        ),
    ] = None,
    columns: Annotated[
        list[str] | None,
        typer.Option(
            metavar="QUANTITY=A,B,C",
            help="Columns of a quantity (acc, gyr, mag, quat, time) in the order of its axes; or NODE.acc=….",
        ),
    ] = None,
    units: Annotated[
        list[str] | None,
        typer.Option(metavar="QUANTITY=UNIT", help="Unit of the file's numbers, such as acc=g or gyr=deg/s."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Rate in Hz, of a file without times or to write at.", min=1.0)
    ] = None,
    name: Annotated[
        list[str] | None, typer.Option(metavar="OLD=NEW", help="Give a node another name; repeat for more.")
    ] = None,
    node: Annotated[list[str] | None, typer.Option(help="Write only this node; repeat for more.")] = None,
    profile: Annotated[str, typer.Option(help="Profile that an mcap is for.")] = "nursing",
    force: Annotated[
        bool, typer.Option("--force", help="Write it even if its units or axes contradict each other.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Read recordings of others, check their times, units and axes, and write them as npz or mcap.

    Formats: CSV, Xsens .txt and .mvnx, x-IMU3, OpenSim .sto and .trc, MATLAB, ROS bags (docs/recordings.md).

    Example: `tandem import left.csv --units acc=g,gyr=deg/s --name left=left_forearm --to npz`
    """
    from common.recording.formats.registry import read_nodes

    path = out or files[0].with_suffix(f".{to}")
    if path.suffix.lower() != f".{to}":
        raise TandemError(f"--out {path}: expected a name that ends in .{to}")
    read = read_nodes(files, _options(columns or (), units or (), rate), _renamed(name or ()))
    nodes = _only(read.nodes, node or ())
    judged = _judged(read, nodes, Console(stderr=True), force=force)
    notes = _write(to, path, nodes, rate, profile)
    notes += [found.refused for found in judged.values() if found.refused]
    if as_json:
        tree = _tree(path, read, judged, (*read.notes, *notes))
        typer.echo(json.dumps(tree, indent=2, ensure_ascii=False))
        return
    console = Console()
    _show(read, judged, console)
    for note in notes:
        console.print(note, style="yellow", highlight=False, markup=False)
    console.print(f"written: {path}", style="dim", highlight=False, soft_wrap=True)


def _only(nodes: Mapping[str, NodeRecording], chosen: Sequence[str]) -> dict[str, NodeRecording]:
    """The nodes that are chosen; all where none is named. Raises TandemError."""
    missing = [name for name in chosen if name not in nodes]
    if missing:
        raise TandemError(f"--node {', '.join(missing)}: is not there; there are {', '.join(nodes)}")
    return {name: found for name, found in nodes.items() if not chosen or name in chosen}


def _judged(
    read: ReadNodes, nodes: Mapping[str, NodeRecording], console: Console, *, force: bool
) -> dict[str, ImportJudgement]:
    """What the units and axes of each node are judged to be. Raises TandemError where they contradict."""
    from deploy.ops.convert.judge import judge

    judged = {name: judge(found) for name, found in nodes.items()}
    refused = [found.refused for found in judged.values() if found.refused]
    if refused and not force:
        _show(read, judged, console)
        raise TandemError("\n".join(refused) + "\n(--force writes it all the same)")
    return judged


def _write(
    to: Target, path: Path, nodes: Mapping[str, NodeRecording], rate_hz: float | None, profile: str
) -> list[str]:
    """Write the file; what is to be said of it."""
    from deploy.ops.convert.write import write_npz, write_suit

    if to is Target.NPZ:
        return list(write_npz(path, nodes, rate_hz))
    return list(write_suit(path, nodes, rate_hz, profile))


def _options(
    columns: list[str] | tuple[()], units: list[str] | tuple[()], rate_hz: float | None
) -> ReadOptions:
    from common.recording.formats.csv_file import parse_units
    from common.recording.formats.samples import ReadOptions

    chosen = {}
    for item in columns:
        quantity, equals, names = item.partition("=")
        if not equals or not names:
            raise TandemError(f"--columns {item}: expected a quantity and its columns, such as acc=ax,ay,az")
        chosen[quantity.strip()] = tuple(word.strip() for word in names.split(","))
    return ReadOptions(chosen, parse_units(list(units)), rate_hz)


def _renamed(items: list[str] | tuple[()]) -> dict[str, str]:
    out = {}
    for item in items:
        old, equals, new = item.partition("=")
        if not equals or not old or not new:
            raise TandemError(f"--name {item}: expected OLD=NEW")
        out[old] = new
    return out


def _show(read: ReadNodes, judged: dict[str, ImportJudgement], console: Console) -> None:
    from numpy import isnan

    table = plain_table("node", "Hz", "samples", "missing", "s", "at rest m/s²")
    for name, judgement in judged.items():
        one = read.nodes[name]
        lost = int(isnan(one.gyr_rad_s).any(axis=1).sum())
        table.add_row(
            name, f"{one.rate_hz:.4g}", str(len(one.gyr_rad_s)), str(lost), f"{one.duration_s:.1f}",
            number(judgement.gravity_m_s2, 2),
        )  # fmt: skip
    console.print(table)
    for note in read.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    for name, judgement in judged.items():
        if judgement.words:
            console.print(f"{name}: {judgement.words}", highlight=False, markup=False, soft_wrap=True)


def _tree(
    path: Path, read: ReadNodes, judged: dict[str, ImportJudgement], notes: tuple[str, ...]
) -> dict[str, object]:
    nodes = {
        name: {
            "rate_hz": read.nodes[name].rate_hz,
            "samples": len(read.nodes[name].gyr_rad_s),
            "gravity_m_s2": judgement.gravity_m_s2,
            "judged": judgement.refused or judgement.words,
        }
        for name, judgement in judged.items()
    }
    return {"written": str(path), "nodes": nodes, "notes": list(notes)}
