"""Options that the calibrations from a recording share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RecordingFile = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING",
        help="Recording of one node or of a whole suit: .npz, .mcap, or any format of docs/recordings.md.",
    ),
]
OutFolder = Annotated[
    Path,
    typer.Option(
        "--out",
        help="Folder for the calibration files NODE.toml and their pictures; other "
        "sections of an existing file stay.",
    ),
]
Nodes = Annotated[list[str] | None, typer.Option("--node", help="Calibrate only this node; repeat for more.")]


def _hemisphere(text: str) -> str:
    if text not in ("north", "south"):
        raise typer.BadParameter("expected north or south")
    return text


HemisphereOption = Annotated[
    str,
    typer.Option(
        metavar="north|south",
        help="Hemisphere where the recording was made. The dip of the field there shows a "
        "mirrored magnetometer axis.",
        callback=_hemisphere,
    ),
]
