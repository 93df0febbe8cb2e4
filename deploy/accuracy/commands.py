"""`tandem accuracy`: its commands, one file each."""

from __future__ import annotations

import typer

from deploy.accuracy.files import files
from deploy.accuracy.group import FilesByDefault
from deploy.accuracy.hinge import hinge
from deploy.accuracy.papers.command import papers

app = typer.Typer(no_args_is_help=True, cls=FilesByDefault)


@app.callback()
def _group() -> None:
    """How good the estimation is: on recordings and beside the papers.

    `tandem accuracy FILE...` scores the filters on recordings: short for `tandem accuracy files FILE...`.

    Example: `tandem accuracy recording.npz --filter all --report scores.json`
    """


app.command("files")(files)
app.command("papers")(papers)
app.command("hinge")(hinge)
