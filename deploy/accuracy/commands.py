"""`tandem accuracy`: its commands, one file each."""

from __future__ import annotations

import typer

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """How good the estimation is: on recordings and beside the papers."""
