"""`tandem calibrate mag`: the magnetometer from free rotation."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from deploy.calibrate.options import HemisphereOption, Nodes, OutFolder, RecordingFile
from deploy.report.options import AsJson, ReportFile

if TYPE_CHECKING:
    from deploy.calibrate.session import Session
    from master.calibrate.magnetic import MagneticCalibration
    from master.calibrate.recording import NodeRecording


def _axes(text: str | None) -> str | None:
    from master.calibrate.magnetometer_axes import axes_matrix

    if text is not None:
        try:
            axes_matrix(text)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
    return text


def mag(
    recording: RecordingFile,
    out: OutFolder = Path("calibration"),
    node: Nodes = None,
    hemisphere: HemisphereOption = "north",
    axes: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Accept swapped axes: name the readings, with signs, that are the node's "
            "x, y and z, as in y,x,-z.",
            callback=_axes,
        ),
    ] = None,
    overflow: Annotated[
        list[float] | None,
        typer.Option(help='A value that means "out of range" in the recording; may be repeated.'),
    ] = None,
    report: ReportFile = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate magnetometers from a recording: 3 minutes of free rotation through every attitude.

    The magnetometer's axes are aligned with the accelerometer's if the folder already has the node's
    accelerometer calibration and the recording rests in eight attitudes or more. The field must turn as
    gyroscope and gravity say: swapped axes are refused unless --axes accepts them, mirrored axes always.

    Example: `tandem calibrate mag rotation.npz --out calibration --node left_hand`
    """
    from deploy.calibrate import session as sessions
    from deploy.calibrate.pictures import draw_magnetic
    from master.calibrate.magnetic import MagneticOptions, calibrate_magnetic
    from master.calibrate.magnetometer_axes import axes_matrix, hemisphere_named
    from master.calibrate.node_file import accelerometer_map

    options = MagneticOptions(
        hemisphere_named(hemisphere), None if axes is None else axes_matrix(axes), tuple(overflow or ())
    )

    def calibrate(raw: NodeRecording, _: Callable[[float], None]) -> MagneticCalibration:
        return calibrate_magnetic(raw, accelerometer_map(out, raw.name), options)

    sessions.make_folder(out)
    day = date.today()
    session = sessions.calibrate_nodes(recording, node or [], calibrate, Console(stderr=True))
    written = sessions.write_nodes(session, recording, out, day)
    for name, found in session.found.items():
        draw_magnetic(found, out / f"{name}_mag.png")
    sessions.tell_machines(sessions.report(session, recording, day, _gist), report, to_stdout=as_json)
    if not as_json:
        _print(session, written, Console())
    sessions.refuse(session, recording)


def _gist(found: MagneticCalibration) -> dict[str, Any]:
    return {
        "field_ut": found.fit.field_ut,
        "coverage": found.coverage,
        "aligned_deg": None if found.rotation is None else math.degrees(found.rotation.angle_rad),
        "evidence": [one.as_report() for one in found.evidence],
        "hold_out_percent": 100.0 * found.hold_out_spread_ut / found.fit.field_ut,
    }


def _print(session: Session[MagneticCalibration], written: dict[str, Path], console: Console) -> None:
    from deploy.calibrate.views import magnetic_table, notes

    if session.found:
        console.print(magnetic_table(session.found))
        notes(session.found, written, console)
