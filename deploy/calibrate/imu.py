"""`tandem calibrate imu`: accelerometer and gyroscope from a session of many attitudes."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from deploy.calibrate.options import Nodes, OutFolder, RecordingFile
from deploy.report.options import AsJson, ReportFile

if TYPE_CHECKING:
    from deploy.calibrate.session import Session
    from master.calibrate.inertial import InertialCalibration
    from master.calibrate.recording import NodeRecording

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
    from deploy.calibrate import session as sessions
    from deploy.calibrate.pictures import draw_inertial
    from master.calibrate.inertial import InertialOptions, calibrate_inertial

    if method == "six-position":
        choice = (gravity, still_s, turn_deg)
        _six_position(recording, (out, node or [], report), choice, as_json=as_json)
        return
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


def _six_position(
    recording: Path,
    where: tuple[Path, list[str], Path | None],
    choice: tuple[float, float, float],
    *,
    as_json: bool,
) -> None:
    from deploy.calibrate import session as sessions
    from deploy.calibrate.views import notes, six_position_table
    from master.calibrate.six_position_session import (
        SixPositionCalibration,
        SixPositionOptions,
        calibrate_six_position,
    )

    out, nodes, report = where
    options = SixPositionOptions(choice[0], math.radians(choice[2]), choice[1])

    def calibrate(raw: NodeRecording, _: Callable[[float], None]) -> SixPositionCalibration:
        return calibrate_six_position(raw, options)

    def gist(found: SixPositionCalibration) -> dict[str, Any]:
        return {
            "method": "six-position",
            "still_intervals": len(found.still),
            "turns": len(found.gyroscope.after_rad),
            "tilt_deg": math.degrees(found.accelerometer.tilt_rad),
            "evidence": [one.as_report() for one in found.evidence],
        }

    sessions.make_folder(out)
    day = date.today()
    session = sessions.calibrate_nodes(recording, nodes, calibrate, Console(stderr=True))
    written = sessions.write_nodes(session, recording, out, day)
    sessions.tell_machines(sessions.report(session, recording, day, gist), report, to_stdout=as_json)
    if not as_json and session.found:
        console = Console()
        console.print(six_position_table(session.found))
        notes(session.found, written, console)
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
