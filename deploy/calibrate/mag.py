"""`tandem calibrate mag`: the magnetometer from free rotation."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deploy.calibrate.options import HemisphereOption, Nodes, OutFolder, RecordingFile
from deploy.report.options import AsJson, ReportFile

if TYPE_CHECKING:
    from common.quaternion import Array
    from deploy.calibrate.session import NodeMethod
    from master.calibrate.magnetic import MagneticCalibration
    from master.calibrate.magnetometer_axes import Hemisphere
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
    from deploy.calibrate.session import run_command
    from master.calibrate.magnetometer_axes import axes_matrix, hemisphere_named

    matrix = None if axes is None else axes_matrix(axes)
    method = rotation_method(out, hemisphere_named(hemisphere), matrix, tuple(overflow or ()))
    run_command(method, recording, node, out, report, as_json=as_json)


def rotation_method(
    folder: Path, hemisphere: Hemisphere, axes: Array | None = None, overflow_ut: tuple[float, ...] = ()
) -> NodeMethod[MagneticCalibration]:
    """Calibration from free rotation; `folder` holds the accelerometers' calibrations, if there are any."""
    from deploy.calibrate.pictures import draw_magnetic
    from deploy.calibrate.session import NodeMethod
    from deploy.calibrate.views import magnetic_table
    from master.calibrate.magnetic import MagneticOptions, calibrate_magnetic
    from master.calibrate.node_file import accelerometer_map

    options = MagneticOptions(hemisphere, axes, overflow_ut)

    def calibrate(raw: NodeRecording, _: Callable[[float], None]) -> MagneticCalibration:
        return calibrate_magnetic(raw, accelerometer_map(folder, raw.name), options)

    def summary(found: MagneticCalibration) -> dict[str, object]:
        return {
            "field_ut": found.fit.field_ut,
            "coverage": found.coverage,
            "aligned_deg": None if found.rotation is None else math.degrees(found.rotation.angle_rad),
            "evidence": [one.as_report() for one in found.evidence],
            "hold_out_percent": 100.0 * found.hold_out_spread_ut / found.fit.field_ut,
        }

    return NodeMethod(calibrate, magnetic_table, summary, draw_magnetic, "mag")
