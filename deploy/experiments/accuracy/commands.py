"""`tandem accuracy`: its commands, one file each."""

from __future__ import annotations

import typer

from deploy.experiments.accuracy.files import files
from deploy.experiments.accuracy.hinge import hinge
from deploy.experiments.accuracy.papers.command import papers
from deploy.report.group import FilesByDefault

app = typer.Typer(no_args_is_help=True, cls=FilesByDefault)


@app.callback()
def _group() -> None:
    """Measure the accuracy of the orientation filters, on recordings and against the papers.

    `tandem accuracy FILE...` scores the filters on recordings: short for `tandem accuracy files FILE...`.

    Example: `tandem accuracy recording.npz --filter all --report scores.json`
    """


app.command("files")(files)
app.command("papers")(papers)
app.command("hinge")(hinge)
