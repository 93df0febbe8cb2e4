"""`tandem calibrate imu`: accelerometer and gyroscope from a session of many attitudes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deploy.calibrate.options import Nodes, OutFolder, RecordingFile
from deploy.report.options import AsJson, ReportFile

if TYPE_CHECKING:
    from deploy.calibrate.session import NodeMethod
    from master.calibrate.inertial import InertialCalibration
    from master.calibrate.recording import NodeRecording
    from master.calibrate.six_position_session import SixPositionCalibration

_STANDARD_GRAVITY_M_S2 = 9.80665


def _method(text: str) -> str:
    if text not in ("attitudes", "six-position"):
        raise typer.BadParameter("expected attitudes or six-position")
    return text


def imu(
    recording: RecordingFile,
    out: OutFolder = Path("calibration"),
    node: Nodes = None,
    gravity: Annotated[
        float, typer.Option(help="Gravity where the recording was made, m/s².", min=9.7, max=9.9)
    ] = _STANDARD_GRAVITY_M_S2,
    still_s: Annotated[
        float, typer.Option(help="Shortest rest that counts, in seconds.", min=1.0, max=60.0)
    ] = 2.0,
    method: Annotated[
        str,
        typer.Option(
            metavar="attitudes|six-position",
            help="`attitudes`: 20 or more attitudes. `six-position`: six faces and three "
            "turns, which gives the axes of the housing.",
            callback=_method,
        ),
    ] = "attitudes",
    turn_deg: Annotated[
        float,
        typer.Option(
            help="Angle in degrees of each of the three turns of six-position.", min=90.0, max=3600.0
        ),
    ] = 360.0,
    report: ReportFile = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate accelerometers and gyroscopes from a recording: 20 or more attitudes, some seconds each.

    With `--method six-position`, rest the node on each of its six faces, in any order, and turn it by a known
    angle (a whole turn, or `--turn-deg` on a turntable) about each of its axes, from rest to rest.

    Example: `tandem calibrate imu session.npz --out calibration --report imu.json`
    """
    from deploy.calibrate.session import run_command

    if method == "six-position":
        six = six_position_method(gravity, still_s, math.radians(turn_deg))
        run_command(six, recording, node, out, report, as_json=as_json)
    else:
        attitudes = attitudes_method(gravity, still_s)
        run_command(attitudes, recording, node, out, report, as_json=as_json)


def attitudes_method(gravity_m_s2: float, still_s: float) -> NodeMethod[InertialCalibration]:
    """Calibration from many attitudes."""
    from deploy.calibrate.pictures import draw_inertial
    from deploy.calibrate.session import NodeMethod
    from deploy.calibrate.views import inertial_table
    from master.calibrate.inertial import InertialOptions, calibrate_inertial

    options = InertialOptions(gravity_m_s2, still_s)

    def calibrate(raw: NodeRecording, progress: Callable[[float], None]) -> InertialCalibration:
        return calibrate_inertial(raw, options, progress)

    def summary(found: InertialCalibration) -> dict[str, object]:
        return {
            "still_intervals": len(found.still),
            "attitudes": found.attitudes,
            "evidence": [one.as_report() for one in found.evidence],
            "moves": len(found.gyroscope.errors_rad),
            "accelerometer_cost_m4_s8": found.accelerometer.cost,
            "gyroscope_cost": found.gyroscope.cost,
        }

    return NodeMethod(calibrate, inertial_table, summary, draw_inertial, "imu")


def six_position_method(
    gravity_m_s2: float, still_s: float, turn_rad: float
) -> NodeMethod[SixPositionCalibration]:
    """Calibration from six faces and three turns."""
    from deploy.calibrate.session import NodeMethod
    from deploy.calibrate.views import six_position_table
    from master.calibrate.six_position_session import SixPositionOptions, calibrate_six_position

    options = SixPositionOptions(gravity_m_s2, turn_rad, still_s)

    def calibrate(raw: NodeRecording, _: Callable[[float], None]) -> SixPositionCalibration:
        return calibrate_six_position(raw, options)

    def summary(found: SixPositionCalibration) -> dict[str, object]:
        return {
            "method": "six-position",
            "still_intervals": len(found.still),
            "turns": len(found.gyroscope.after_rad),
            "tilt_deg": math.degrees(found.accelerometer.tilt_rad),
            "evidence": [one.as_report() for one in found.evidence],
        }

    return NodeMethod(calibrate, six_position_table, summary)
