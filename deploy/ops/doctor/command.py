"""`tandem doctor`."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError


def doctor(
    config: Annotated[
        Path | None, typer.Argument(help="The host's TOML file; without it, what every host needs.")
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set one key over the file.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="For machines.")] = False,
    reach: Annotated[bool, typer.Option(help="Whether to ask the robots and routers of the file.")] = True,
    recordings: Annotated[Path, typer.Option(help="Where recordings are to be written.")] = Path(),
) -> None:
    """Check whether this host is ready for its role, and say what to do. It changes nothing.

    Status 1 where something must be mended first.

    Example: `tandem doctor /etc/tandem/operator.toml --recordings /var/lib/tandem`
    """
    from deploy.ops.doctor.examine import Options, examine
    from deploy.ops.doctor.judge.finding import Verdict, worst
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
    if worst(found) is Verdict.FAIL:
        raise TandemError(f"not ready: {words}")
