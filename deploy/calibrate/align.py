"""`tandem calibrate align`: how each unit sits on its segment, from a zero pose and a motion."""

from __future__ import annotations

import math
import re
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.calibrate.options import OutFolder, RecordingFile
from deploy.report.options import AsJson, ReportFile

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.table import Table

    from common.skeleton import Skeleton
    from master.calibrate.alignment import SuitAlignment
    from master.calibrate.joint_motion import JointFinding
    from master.calibrate.recording import NodeRecording


_TIMES = re.compile(r"([0-9]+(?:\.[0-9]*)?):([0-9]+(?:\.[0-9]*)?)")


def _times(text: str | None) -> str | None:
    if text is not None:
        found = _TIMES.fullmatch(text)
        if found is None or not float(found[1]) < float(found[2]):
            raise typer.BadParameter("expected FROM:TO in seconds from the beginning, such as 0.5:4")
    return text


def align(
    recording: RecordingFile,
    profile: Annotated[str, typer.Option(help="Robot profile whose segments carry the nodes.")] = "nursing",
    out: OutFolder = Path("calibration"),
    zero_pose: Annotated[
        str | None,
        typer.Option(
            metavar="FROM:TO",
            help="Seconds of the zero pose at the beginning; without it, the first time when all nodes rest.",
            callback=_times,
        ),
    ] = None,
    report: ReportFile = None,
    as_json: AsJson = False,
) -> None:
    """Find how each worn sensor is turned against its segment: stand in the zero pose, then move every joint.

    Stand upright, arms hanging, palms to the thighs, for three seconds; then bend elbows, knees and fingers
    ten times each while you walk, bow and turn, 20 s or more. No magnetometer is needed. Calibrations of
    `imu` in the folder are applied first.

    Example: `tandem calibrate align session.mcap --profile nursing --out calibration`
    """
    from common.skeleton import load_skeleton
    from deploy.calibrate.session import make_folder, output_json
    from master.calibrate.alignment_files import of_profile
    from master.calibrate.recording import load_recordings

    skeleton = load_skeleton(profile)
    make_folder(out)
    recorded = load_recordings(recording)
    between = None if zero_pose is None else (float(zero_pose.split(":")[0]), float(zero_pose.split(":")[1]))
    nodes = of_profile(recorded, skeleton)
    found = align_to_files(nodes, skeleton, between, recording, out, Console(stderr=True))
    figures = as_report(found, recording)
    output_json(figures, report, to_stdout=as_json)
    if not as_json:
        console = Console()
        console.print(nodes_table(found), joints_table(found))
        for note in dict.fromkeys(note for node in recorded.values() for note in node.notes):
            console.print(note, style="yellow", highlight=False, markup=False)
        if found.nodes:
            console.print(
                f"zero pose {found.zero_pose_s[0]:.1f} to {found.zero_pose_s[1]:.1f} s; written to {out}; "
                "angles over the recording: alignment.png"
            )
    if found.refused:
        raise TandemError("\n".join(f"{recording}: {line}" for line in refusals(found)))


def align_to_files(
    recorded: Mapping[str, NodeRecording],
    skeleton: Skeleton,
    zero_pose_s: tuple[float, float] | None,
    recording: Path,
    folder: Path,
    console: Console,
    *,
    picture: bool = True,
) -> SuitAlignment:
    """Find how the nodes sit, their `imu` calibrations applied; write it to their files, and the picture."""
    from rich.progress import Progress

    from deploy.calibrate.align_picture import draw_angles
    from master.calibrate.alignment import find_alignment
    from master.calibrate.alignment_files import calibrated, write_alignment

    nodes = calibrated(recorded, folder)
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("joints", total=None)

        def progress(done: int, of: int) -> None:
            bar.update(task, completed=done, total=of)

        found = find_alignment(nodes, skeleton, zero_pose_s, progress)
    write_alignment(found, recording, folder, date.today())
    if picture and found.nodes:
        draw_angles(nodes, skeleton, found, folder / "alignment.png")
    return found


def refusals(found: SuitAlignment) -> list[str]:
    """A line for each reason, with the nodes that are not written for it."""
    from deploy.calibrate.session import by_words

    return [
        f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} not written: {why}"
        for why, names in by_words(found.refused.items()).items()
    ]


def as_report(found: SuitAlignment, recording: Path) -> dict[str, object]:
    """Everything found, for machines; angles in degrees."""
    return {
        "recording": recording.name,
        "zero_pose_s": list(found.zero_pose_s),
        "nodes": {
            name: {
                "q_sensor_from_segment": node.q_sensor_from_segment.tolist(),
                "sigma_deg": math.degrees(node.sigma_rad),
                "tilt_deg": None if node.tilt_rad is None else math.degrees(node.tilt_rad),
                "heading_deg": math.degrees(node.heading_rad),
                "told_by": node.told_by,
            }
            for name, node in found.nodes.items()
        },
        "joints": {joint.segment: _joint(joint) for joint in found.joints},
        "refused": found.refused,
        "evidence": {name: [e.as_report() for e in evidence] for name, evidence in found.evidence.items()},
    }


def _joint(joint: JointFinding) -> dict[str, object]:
    fit = joint.fit
    axes = fit is not None and joint.axes_known
    return {
        "parent": joint.parent,
        "kind": joint.kind,
        "refusal": joint.refusal,
        "offset_deg": None if fit is None else math.degrees(fit.offset_rad),
        "offset_sigma_deg": None if fit is None else math.degrees(fit.offset_sigma_rad),
        "axis_sigma_deg": [math.degrees(s) for s in fit.axis_sigma_rad] if fit and axes else None,
        "misfit": None if fit is None else fit.misfit,
        "flexion_deg": None if joint.flexion_deg is None else list(joint.flexion_deg),
    }


def nodes_table(found: SuitAlignment) -> Table:
    """One row a node: what its heading was found by, and its uncertainty."""
    from rich import box
    from rich.table import Table

    table = Table(title="alignment", box=box.SIMPLE_HEAD)
    for head in ("node", "facing found by", "± °", "axis off level °", ""):
        table.add_column(head, justify="right" if "°" in head else "left")
    for name, node in found.nodes.items():
        tilt = "" if node.tilt_rad is None else f"{math.degrees(node.tilt_rad):.1f}"
        table.add_row(name, node.told_by, f"{math.degrees(node.sigma_rad):.1f}", tilt, "[green]written")
    for name in found.refused:
        table.add_row(name, "", "", "", "[red]refused")
    return table


def joints_table(found: SuitAlignment) -> Table:
    """One row per joint: what its motion shows."""
    from rich import box
    from rich.table import Table

    table = Table(title="joints", box=box.SIMPLE_HEAD)
    for head in ("joint", "kind", "heading °", "± °", "axes ± °", "bent ° (5 to 95 %)"):
        table.add_column(head, justify="left" if head in ("joint", "kind") else "right")
    for joint in found.joints:
        row = [f"{joint.segment}", joint.kind, "", "", "", ""]
        if joint.fit is not None:
            row[2] = f"{math.degrees(joint.fit.offset_rad):.0f}"
            row[3] = f"{math.degrees(joint.fit.offset_sigma_rad):.1f}"
            if joint.axes_known:
                row[4] = " ".join(f"{math.degrees(s):.1f}" for s in joint.fit.axis_sigma_rad)
        if joint.flexion_deg is not None:
            row[5] = f"{joint.flexion_deg[0]:.0f} to {joint.flexion_deg[1]:.0f}"
        table.add_row(*row, style="yellow" if joint.refusal else None)
    return table
