"""`tandem doctor`."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.report.options import AsJson, Overrides


def doctor(
    config: Annotated[
        Path | None,
        typer.Argument(
            help="TOML file of this host's role; without it, only what every host needs is checked."
        ),
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
    reach: Annotated[
        bool, typer.Option(help="Also connect to the robots and routers that the file names.")
    ] = True,
    recordings: Annotated[
        Path, typer.Option(help="Folder for recordings; its free space is checked.")
    ] = Path(),
) -> None:
    """Check whether this host is ready for its role, and print what to do. It changes nothing.

    It ends with status 1 if something must be fixed first.

    Example: `tandem doctor /etc/tandem/operator.toml --recordings /var/lib/tandem`
    """
    from deploy.ops.doctor.examine import Options, examine
    from deploy.ops.doctor.judge.finding import Health, worst
    from deploy.ops.doctor.judge.needs import Needs, needs_of
    from deploy.ops.doctor.read.tree import Tree
    from deploy.ops.doctor.view import as_table, as_tree, in_words

    needs = Needs() if config is None else needs_of(config, set_ or ())
    found = asyncio.run(examine(needs, Options(recordings, reach), Tree()))
    words = in_words(needs.role, found)
    if as_json:
        typer.echo(json.dumps(as_tree(needs.role, found), indent=2, ensure_ascii=False))
    else:
        console = Console()
        console.print(as_table(found))
        console.print(words, highlight=False)
    if worst(found) is Health.FAIL:
        raise TandemError(f"not ready: {words}")
