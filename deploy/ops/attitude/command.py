"""`tandem attitude`: the angles of an attitude instrument, live."""

from __future__ import annotations

import asyncio
from typing import Annotated

import typer
from rich.console import Console

from common.process.runtime import run as run_until_stopped


def attitude(
    port: Annotated[
        str | None,
        typer.Argument(metavar="[PORT]", help="Serial port of the instrument, such as /dev/ttyUSB0."),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Simulate the instrument instead of reading one.")
    ] = False,
    baud: Annotated[int, typer.Option(help="Baud rate of the serial port.", min=300)] = 9600,
    declination: Annotated[
        float,
        typer.Option(
            help="Magnetic declination at your place in degrees, positive where the "
            "needle points east of north.",
            min=-180,
            max=180,
        ),
    ] = 0.0,
    to: Annotated[
        str | None,
        typer.Option(metavar="PORT", help="Write the simulated instrument's frames to this serial port."),
    ] = None,
    inclination: Annotated[
        float, typer.Option(help="Inclination of the simulated instrument in degrees.", min=0, max=180)
    ] = 10.0,
    azimuth: Annotated[
        float, typer.Option(help="Azimuth of the simulated instrument in degrees.", min=0, max=360)
    ] = 235.0,
    tool_face: Annotated[
        float, typer.Option(help="Tool-face of the simulated instrument in degrees.", min=0, max=360)
    ] = 56.0,
    seconds: Annotated[
        float | None,
        typer.Option(
            help="Stop after this many seconds; without it, stop with Ctrl-C.", min=0.1, show_default=False
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object per reading, with angles in degrees.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Random seed for the simulated instrument's noise.")] = 1,
) -> None:
    """Show what an attitude instrument on a local serial port measures: inclination, azimuth, tool-face.

    Example: `tandem attitude /dev/ttyUSB0 --declination -2.5`, or `tandem attitude --simulate --seconds 10`
    """
    if (port is None) == (not simulate):
        raise typer.BadParameter("name the instrument's PORT, or else --simulate one")
    if to is not None and not simulate:
        raise typer.BadParameter("--to needs --simulate and no instrument port")
    from deploy.ops.attitude.run import AttitudeOptions, show_attitude

    options = AttitudeOptions(
        port=port, baud=baud, to=to, declination_deg=declination, inclination_deg=inclination,
        azimuth_deg=azimuth, tool_face_deg=tool_face, seconds=seconds, as_json=as_json, seed=seed,
    )  # fmt: skip

    async def show(stop: asyncio.Event) -> None:
        await show_attitude(options, stop, Console())

    run_until_stopped(show)
