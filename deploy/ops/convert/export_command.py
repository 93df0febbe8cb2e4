"""`tandem export`: joint angles of a recording, for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.ops.convert.joints import AngleSource
from deploy.report.output import in_a_folder

if TYPE_CHECKING:
    from common.skeleton import Skeleton


class ExportFormat(StrEnum):
    """What is written."""

    CSV = "csv"
    BVH = "bvh"
    MOT = "mot"
    BAG = "bag"
    MCAP = "mcap"
    FOXGLOVE = "foxglove"
    PARQUET = "parquet"
    LEROBOT = "lerobot"
    BIDS = "bids"
    SHARE = "share"


WHOLE = (ExportFormat.FOXGLOVE, ExportFormat.PARQUET, ExportFormat.LEROBOT, ExportFormat.BIDS)
"""Formats of the whole recording; the others take the joint angles of one source."""
ENDINGS = {
    ExportFormat.BAG: "_ros2",
    ExportFormat.MCAP: "_ros2",
    ExportFormat.FOXGLOVE: "_foxglove.mcap",
    ExportFormat.LEROBOT: "_lerobot",
    ExportFormat.BIDS: "_bids",
    ExportFormat.SHARE: "_shared.mcap",
}
"""What a name gets where it is not the format's own."""


def export_joints(
    file: Annotated[Path, typer.Argument(help="An .mcap file that `tandem record` wrote.", dir_okay=False)],
    to: Annotated[
        ExportFormat,
        typer.Option(
            help="csv; bvh; mot (OpenSim); bag or mcap (ROS 2 bag of JointState, sqlite3 or mcap); foxglove "
            "(for viewers); parquet (one table); lerobot (a dataset to learn from); bids (BIDS-Motion); "
            "share (a copy without names, dates, hosts and pictures)."
        ),
    ] = ExportFormat.CSV,
    out: Annotated[
        Path | None, typer.Option(help="New file or folder; by default FILE's name.", callback=in_a_folder)
    ] = None,
    of: Annotated[AngleSource, typer.Option(help="Whose angles to write.")] = AngleSource.ENCODERS,
    profile: Annotated[
        str | None,
        typer.Option(help="Profile of the robot; by default the recording says it, else nursing."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            help="Frames per second; by default the recording's (bvh), 50 (parquet, bids), 25 (lerobot).",
            min=1.0,
            max=200.0,
        ),
    ] = None,
    task: Annotated[
        str | None, typer.Option(help="lerobot: what the robot does, in words. bids: one word.")
    ] = None,
    subject: Annotated[str, typer.Option(help="bids: the subject's code, never a name.")] = "01",
    key: Annotated[
        Path | None,
        typer.Option(help="share: file of the secret that gives codes; a new one is made.", dir_okay=False),
    ] = None,
    session: Annotated[str, typer.Option(help="bids: which session of that subject.")] = "1",
) -> None:
    """Write the joint angles of a recording as CSV, BVH, OpenSim .mot or a ROS 2 bag.

    --to parquet, lerobot and bids write encoders, setpoints and commands together: at each instant the newest
    that had arrived by then.

    --to foxglove writes a copy for viewers such as Foxglove and Rerun: the robot with its frames, joints,
    pictures, guard, latency and log. They open it with no set-up.

    --to share writes a copy for others: sensors, commands, encoders and marks, each message made anew without
    texts; codes in place of names, dates shifted by years, no pictures. Motion itself can identify a person.

    Example: `tandem export morning.mcap --to bvh --of encoders --out morning.bvh`
    """
    from deploy.recorded.profile import recorded_skeleton

    path = _named(file, to, out)
    skeleton = recorded_skeleton([file], profile)
    if to is ExportFormat.SHARE:
        said = _share(file, out, key, skeleton)
    elif to in WHOLE:
        from deploy.ops.convert.whole import WholeOptions, write_whole

        said = write_whole(to.value, WholeOptions(file, path, skeleton, rate, task, subject, session))
    else:
        said = _joints(file, path, to, of, skeleton=skeleton, rate=rate)
    Console().print(f"{path}: {said}", highlight=False, markup=False, soft_wrap=True)


def _named(file: Path, to: ExportFormat, out: Path | None) -> Path:
    """Where to write. Raises TandemError for a name with another format's ending."""
    usual = file.with_name(file.stem + ENDINGS.get(to, f".{to}"))
    path = out or usual
    if usual.suffix and path.suffix.lower() != usual.suffix:
        raise TandemError(f"--out {path}: expected a name that ends in {usual.suffix}")
    return path


def _share(file: Path, out: Path | None, key: Path | None, skeleton: Skeleton) -> str:
    from deploy.ops.convert.share import ShareKey, write_share

    if key is None:
        raise TandemError("export --to share: name the secret's file by --key, outside of what you share")
    if out is None:  # a recording's name holds its date
        raise TandemError("export --to share: name the copy by --out, without date and name")
    return write_share(file, out, skeleton, ShareKey(key))


def _joints(
    file: Path, path: Path, to: ExportFormat, of: AngleSource, *, skeleton: Skeleton, rate: float | None
) -> str:
    """Write the angles of one source; what was written, after what a person should know of it."""
    from deploy.ops.convert.bvh import write_bvh
    from deploy.ops.convert.joint_files import write_bag, write_csv, write_mot
    from deploy.ops.convert.joints import read_joints

    series = read_joints(file, skeleton, of)
    if to is ExportFormat.CSV:
        note = write_csv(path, series)
    elif to is ExportFormat.MOT:
        note = write_mot(path, series)
    elif to is ExportFormat.BVH:
        note = write_bvh(path, series, skeleton, rate or round(series.rate_hz, 3))
    else:
        note = write_bag(path, series, mcap=to is ExportFormat.MCAP)
    for one in (*series.notes, note):
        if one:
            Console().print(one, style="yellow", highlight=False, markup=False)
    return f"{len(series.time_ns)} rows of {len(series.names)} joints, {series.time_s[-1]:.1f} s ({of})"
