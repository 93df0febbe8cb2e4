"""`tandem calibrate imu`: accelerometer and gyroscope from a session of many attitudes."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from deploy.calibrate.options import AsJson, Nodes, OutFolder, RecordingFile, ReportFile

if TYPE_CHECKING:
    from deploy.calibrate.session import Session
    from master.calibrate.inertial import InertialCalibration
    from master.calibrate.recording import NodeRecording

_STANDARD_GRAVITY_M_S2 = 9.80665


def imu(
    recording: RecordingFile,
    out: OutFolder = Path("calibration"),
    node: Nodes = None,
    gravity: Annotated[
        float, typer.Option(help="m/s² where it was recorded.", min=9.7, max=9.9)
    ] = _STANDARD_GRAVITY_M_S2,
    still_s: Annotated[float, typer.Option(help="Shortest rest that counts, s.", min=1.0, max=60.0)] = 2.0,
    report: ReportFile = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate accelerometers and gyroscopes from a recording: 20 or more attitudes, some seconds each.

    Example: `tandem calibrate imu session.npz --out calibration --report imu.json`
    """
    from deploy.calibrate import session as sessions
    from deploy.calibrate.pictures import draw_inertial
    from master.calibrate.inertial import InertialOptions, calibrate_inertial

    options = InertialOptions(gravity, still_s)

    def calibrate(raw: NodeRecording, tell: Callable[[float], None]) -> InertialCalibration:
        return calibrate_inertial(raw, options, tell)

    sessions.make_folder(out)
    day = date.today()
    session = sessions.calibrate_nodes(recording, node or [], calibrate, Console(stderr=True))
    written = sessions.write_nodes(session, recording, out, day)
    for name, found in session.found.items():
        draw_inertial(found, out / f"{name}_imu.png")
    sessions.tell_machines(sessions.report(session, recording, day, _gist), report, to_stdout=as_json)
    if not as_json:
        _print(session, written, Console())
    sessions.refuse(session, recording)


def _gist(found: InertialCalibration) -> dict[str, Any]:
    return {
        "still_intervals": len(found.still),
        "attitudes": found.attitudes,
        "evidence": [one.as_report() for one in found.evidence],
        "moves": len(found.gyroscope.errors_rad),
        "accelerometer_cost_m4_s8": found.accelerometer.cost,
        "gyroscope_cost": found.gyroscope.cost,
    }


def _print(session: Session[InertialCalibration], written: dict[str, Path], console: Console) -> None:
    from deploy.calibrate.views import inertial_table, notes

    if session.found:
        console.print(inertial_table(session.found))
        notes(session.found, written, console)
