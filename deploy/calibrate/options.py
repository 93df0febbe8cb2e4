"""Options that the calibrations from a recording share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deploy.report.output import in_a_folder

RecordingFile = Annotated[
    Path,
    typer.Argument(metavar="RECORDING", help=".npz or .mcap of one unit or a whole suit.", dir_okay=False),
]
OutFolder = Annotated[
    Path, typer.Option("--out", help="Folder for NODE.toml and its picture; other parts of a file stay.")
]
Nodes = Annotated[list[str] | None, typer.Option("--node", help="Only this node; may be repeated.")]
ReportFile = Annotated[
    Path | None, typer.Option(help="Write the figures as JSON.", dir_okay=False, callback=in_a_folder)
]


def _hemisphere(text: str) -> str:
    if text not in ("north", "south"):
        raise typer.BadParameter("expected north or south")
    return text


HemisphereOption = Annotated[
    str,
    typer.Option(
        metavar="north|south",
        help="Where it was recorded: tells a magnetometer's mirror image from the field's dip.",
        callback=_hemisphere,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead of a table.")]
