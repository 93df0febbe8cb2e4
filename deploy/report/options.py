"""Options that many commands share, so that each is explained by the same words everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deploy.report.output import in_a_folder


def _a_png(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".png":
        raise typer.BadParameter(f"{path.name}: expected a name that ends in .png")
    return in_a_folder(path)


ConfigFile = Annotated[
    Path, typer.Argument(help="The TOML file of this process; start from the one in deploy/examples.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace one key of the file for this run, as in `--set 'robot=\"robot-2\"'`; repeat for more. "
        "`@FILE`: all changes in a file, one a line.",
    ),
]
MetricsFile = Annotated[
    Path | None,
    typer.Option(
        "--metrics",
        help="On exit, write all counters and timings to this JSON file.",
        dir_okay=False,
        callback=in_a_folder,
    ),
]
ReportFile = Annotated[
    Path | None,
    typer.Option(
        "--report", help="Write the results to this JSON file.", dir_okay=False, callback=in_a_folder
    ),
]
PlotsFile = Annotated[
    Path | None,
    typer.Option(
        "--plots",
        help="Draw every joint's angle and angular velocity into this PNG file.",
        dir_okay=False,
        callback=_a_png,
    ),
]
ConnectTo = Annotated[
    list[str] | None,
    typer.Option("--connect", help="Endpoint to connect to, such as tcp/192.168.7.2:7447; repeat for more."),
]
LinkFile = Annotated[
    Path | None,
    typer.Option(
        "--link", help="Take endpoints and keys from the section [link] of this TOML file.", dir_okay=False
    ),
]
Cameras = Annotated[
    list[str] | None,
    typer.Option("--video", help="Also take the pictures of this camera, such as `head`; repeat for more."),
]
StopAfter = Annotated[
    float | None,
    typer.Option("--seconds", help="Stop after this many seconds; without it, stop with Ctrl-C.", min=0.1),
]


def _where_it_lies(profile: str) -> str:
    """A profile of one's own by its full path, so that it is found from every folder."""
    path = Path(profile)
    return str(path.resolve()) if path.exists() else profile


WhichRobot = Annotated[
    str,
    typer.Option(
        "--robot-profile",
        help="Robot profile: nursing, hand or lower_limb, or the folder of your own.",
        callback=_where_it_lies,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]
