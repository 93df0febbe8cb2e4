"""`tandem attitude`: the angles of an attitude instrument, live."""

from __future__ import annotations

import asyncio
from typing import Annotated

import typer
from rich.console import Console

from common.process.runtime import run as run_until_stopped

_WHERE = "Of the simulated one, °."


def attitude(
    port: Annotated[
        str | None,
        typer.Argument(metavar="[PORT]", help="The instrument's serial port, such as /dev/ttyUSB0."),
    ] = None,
    simulate: Annotated[bool, typer.Option("--simulate", help="Without an instrument.")] = False,
    baud: Annotated[int, typer.Option(help="Of the port.", min=300)] = 9600,
    declination: Annotated[
        float,
        typer.Option(help="Where you are, °, positive where the needle points east.", min=-180, max=180),
    ] = 0.0,
    to: Annotated[
        str | None, typer.Option(metavar="PORT", help="Send the simulated one's frames there, as it would.")
    ] = None,
    inclination: Annotated[float, typer.Option(help=_WHERE, min=0, max=180)] = 10.0,
    azimuth: Annotated[float, typer.Option(help=_WHERE, min=0, max=360)] = 235.0,
    tool_face: Annotated[float, typer.Option(help=_WHERE, min=0, max=360)] = 56.0,
    seconds: Annotated[
        float | None, typer.Option(help="How long; else until Ctrl-C.", min=0.1, show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a reading, angles in °.")] = False,
    seed: Annotated[int, typer.Option(help="Of the simulated one's noise.")] = 1,
) -> None:
    """Show inclination, azimuth and tool-face of the robot's base.

    Example: `tandem attitude /dev/ttyUSB0 --declination -2.5`, or `tandem attitude --simulate --seconds 10`
    """
    if (port is None) == (not simulate):
        raise typer.BadParameter("name the instrument's PORT, or else --simulate one")
    if to is not None and not simulate:
        raise typer.BadParameter("--to sends what --simulate makes up; leave out the instrument's port")
    from deploy.ops.attitude.run import AttitudeOptions, show_attitude

    options = AttitudeOptions(
        port=port, baud=baud, to=to, declination_deg=declination, inclination_deg=inclination,
        azimuth_deg=azimuth, tool_face_deg=tool_face, seconds=seconds, as_json=as_json, seed=seed,
    )  # fmt: skip

    async def show(stop: asyncio.Event) -> None:
        await show_attitude(options, stop, Console())

    run_until_stopped(show)
