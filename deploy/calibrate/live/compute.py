"""From what was recorded to the nodes' files: the same calculations as `calibrate imu`, `mag` and `align`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import Progress, track

from common.errors import TandemError
from deploy.calibrate import session as sessions
from deploy.calibrate.align import as_report, joints_table, nodes_table
from deploy.calibrate.align import refusals as alignment_refusals
from deploy.calibrate.align_picture import draw_angles
from deploy.calibrate.live.guide import What
from deploy.calibrate.live.run import Session
from deploy.calibrate.pictures import draw_inertial, draw_magnetic
from deploy.calibrate.views import inertial_table, magnetic_table, notes
from deploy.report.output import writing
from master.calibrate.alignment import find_alignment
from master.calibrate.alignment_files import calibrated, write_alignment
from master.calibrate.inertial import InertialCalibration, InertialOptions, calibrate_inertial
from master.calibrate.magnetic import MagneticCalibration, MagneticOptions, calibrate_magnetic
from master.calibrate.magnetometer_axes import Hemisphere
from master.calibrate.node_file import accelerometer_map
from master.calibrate.recording import NodeRecording, load_recordings
from master.config import MasterConfig

Node = TypeVar("Node")


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
    config: MasterConfig, session: Session, choice: Choice, folder: Path, console: Console
) -> tuple[dict[str, Any], list[str]]:
    """Write every node that could be calibrated; the figures, and a line for each refusal."""
    day = date.today()
    figures: dict[str, Any] = {**session.counters}
    refusals: list[str] = []
    inherit(config, folder)
    if session.tray is not None:
        if "imu" in choice.what:
            figures["imu"] = _imu(session.tray, choice, folder, day, console, refusals)
        if "mag" in choice.what:
            figures["mag"] = _mag(config, session.tray, choice, folder, day, console, refusals)
    if session.worn is not None:
        figures["align"] = _align(config, session, choice, folder, day, console, refusals)
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


def _imu(
    path: Path, choice: Choice, folder: Path, day: date, console: Console, refusals: list[str]
) -> dict[str, Any]:
    # rests were asked for a little longer than this
    options = InertialOptions(choice.gravity_m_s2, min(2.0, 0.8 * choice.still_s))

    def calibrate(raw: NodeRecording, tell: Callable[[float], None]) -> InertialCalibration:
        return calibrate_inertial(raw, options, tell)

    found = sessions.calibrate_nodes(path, [], calibrate, console)
    written = sessions.write_nodes(found, path, folder, day)
    if choice.pictures:
        for name, node in _with_progress(found.found, console):
            draw_inertial(node, folder / f"{name}_imu.png")
    if found.found:
        console.print(inertial_table(found.found))
        notes(found.found, written, console)
    refusals += [f"imu: {name}: {why}" for name, why in found.refused.items()]
    return sessions.report(found, path, day, lambda node: {"attitudes": node.attitudes})


def _mag(
    config: MasterConfig,
    path: Path,
    choice: Choice,
    folder: Path,
    day: date,
    console: Console,
    refusals: list[str],
) -> dict[str, Any]:
    def calibrate(raw: NodeRecording, _: Callable[[float], None]) -> MagneticCalibration:
        return calibrate_magnetic(
            raw, accelerometer_map(folder, raw.name), MagneticOptions(choice.hemisphere)
        )

    magnetic = [name for name in load_recordings(path) if config.nodes[name].magnetometer]
    if not magnetic:
        return {}
    found = sessions.calibrate_nodes(path, magnetic, calibrate, console)
    written = sessions.write_nodes(found, path, folder, day)
    if choice.pictures:
        for name, node in _with_progress(found.found, console):
            draw_magnetic(node, folder / f"{name}_mag.png")
    if found.found:
        console.print(magnetic_table(found.found))
        notes(found.found, written, console)
    refusals += [f"mag: {name}: {why}" for name, why in found.refused.items()]
    return sessions.report(found, path, day, lambda node: {"coverage": node.coverage})


def _with_progress(found: Mapping[str, Node], console: Console) -> Iterator[tuple[str, Node]]:
    yield from track(found.items(), "pictures", console=console, transient=True)


def _align(
    config: MasterConfig,
    session: Session,
    choice: Choice,
    folder: Path,
    day: date,
    console: Console,
    refusals: list[str],
) -> dict[str, Any]:
    assert session.worn is not None
    try:
        nodes = calibrated(load_recordings(session.worn), folder)
        with Progress(console=console, transient=True) as progress:
            task = progress.add_task("joints", total=None)
            alignment = find_alignment(
                nodes,
                config.skeleton,
                session.zero_pose_s,
                lambda done, of: progress.update(task, completed=done, total=of),
            )
    except TandemError as error:
        refusals.append(f"align: {error}")
        return {"refused": {"": str(error)}}
    write_alignment(alignment, session.worn, folder, day)
    if choice.pictures and alignment.nodes:
        draw_angles(nodes, config.skeleton, alignment, folder / "alignment.png")
    console.print(nodes_table(alignment), joints_table(alignment))
    refusals += [f"align: {line}" for line in alignment_refusals(alignment)]
    return as_report(alignment, session.worn)
