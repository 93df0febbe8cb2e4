"""From what was recorded to the nodes' files: the same calculations as `calibrate imu`, `mag` and `align`."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from common.errors import TandemError
from deploy.calibrate.align import align_to_files, as_report, joints_table, nodes_table
from deploy.calibrate.align import refusals as alignment_refusals
from deploy.calibrate.imu import attitudes_method
from deploy.calibrate.live.guide import What
from deploy.calibrate.live.run import LiveRecordings
from deploy.calibrate.mag import rotation_method
from deploy.calibrate.session import NodeMethod, Result, calibrate_to_files, show
from deploy.report.output import writing
from master.calibrate.magnetometer_axes import Hemisphere
from master.calibrate.recording import load_recordings
from master.config import MasterConfig


@dataclass(frozen=True, slots=True)
class Choice:
    """What is to be computed, and how."""

    what: tuple[What, ...]
    gravity_m_s2: float
    still_s: float
    hemisphere: Hemisphere = "north"
    pictures: bool = True
    """Draw each node before and after: a second or more a node."""


def compute(
    config: MasterConfig, session: LiveRecordings, choice: Choice, folder: Path, console: Console
) -> tuple[dict[str, object], list[str]]:
    """Write every node that could be calibrated; the figures, and a line for each refusal."""
    figures: dict[str, object] = {**session.counters}
    refusals: list[str] = []
    inherit(config, folder)
    if session.tray is not None and "imu" in choice.what:
        # rests were asked for a little longer than this
        imu = attitudes_method(choice.gravity_m_s2, min(2.0, 0.8 * choice.still_s))
        figures["imu"] = _nodes(imu, session.tray, [], choice, folder, console, refusals)
    if session.tray is not None and "mag" in choice.what:
        mag = rotation_method(folder, choice.hemisphere)
        magnetic = [name for name in load_recordings(session.tray) if config.nodes[name].magnetometer]
        figures["mag"] = (
            _nodes(mag, session.tray, magnetic, choice, folder, console, refusals) if magnetic else {}
        )
    if session.worn is not None:
        figures["align"] = _align(config, session, choice, folder, console, refusals)
    written = sorted(path.stem for path in folder.glob("*.toml") if path.stem in config.nodes)
    if written:
        console.print("To use them, name each in the master's file, as in")
        console.print(
            f'  {written[0]} = {{ …, calibration = "{(folder / written[0]).with_suffix(".toml")}" }}',
            highlight=False,
            markup=False,
        )
    return figures, refusals


def inherit(config: MasterConfig, folder: Path) -> None:
    """Begin with the files that the master's configuration names: what is not calibrated now is not lost."""
    for name, node in config.nodes.items():
        here = folder / f"{name}.toml"
        if node.calibration is not None and node.calibration.is_file() and not here.exists():
            with writing(here):
                shutil.copyfile(node.calibration, here)


def _nodes(
    method: NodeMethod[Result],
    recording: Path,
    names: list[str],
    choice: Choice,
    folder: Path,
    console: Console,
    refusals: list[str],
) -> dict[str, object]:
    """Calibrate single nodes by one method; the report."""
    results, figures = calibrate_to_files(method, recording, names, folder, console, pictures=choice.pictures)
    show(method, results, folder, console)
    refusals += [f"{method.picture}: {name}: {why}" for name, why in results.refused.items()]
    return figures


def _align(
    config: MasterConfig,
    session: LiveRecordings,
    choice: Choice,
    folder: Path,
    console: Console,
    refusals: list[str],
) -> dict[str, object]:
    assert session.worn is not None
    try:
        found = align_to_files(
            load_recordings(session.worn),
            config.skeleton,
            session.zero_pose_s,
            session.worn,
            folder,
            console,
            picture=choice.pictures,
        )
    except TandemError as error:
        refusals.append(f"align: {error}")
        return {"refused": {"": str(error)}}
    console.print(nodes_table(found), joints_table(found))
    refusals += [f"align: {line}" for line in alignment_refusals(found)]
    return as_report(found, session.worn)
