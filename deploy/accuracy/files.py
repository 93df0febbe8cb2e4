"""`tandem accuracy FILE...`: the orientation filters on recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from common.errors import TandemError


def files(
    recordings: Annotated[list[Path], typer.Argument(metavar="FILE...", help="npz of one unit.")],
) -> None:
    """Score the orientation filters on recordings."""
    raise TandemError(f"{recordings[0]}: nothing scores recordings yet")
