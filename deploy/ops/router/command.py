"""`tandem router FILE`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.output import in_a_folder, write_json, writing


def router(
    config: Annotated[Path, typer.Argument(help="TOML file; deploy/examples/router.toml is one.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set one key over the file.")
    ] = None,
    zenohd: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.json5", help="Write the same for a site's own zenohd, and end.", callback=in_a_folder
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(help="Write what was counted, as JSON, when stopped.", callback=in_a_folder),
    ] = None,
) -> None:
    """Route between masters and robots that cannot reach each other, and enforce who may do what.

    Masters and robots connect to it with `[link] mode = "client"`. It sees what it routes: run it where you
    would trust a host to command the robots.

    Example: `tandem router deploy/examples/router.toml`
    """
    from common.link.router import RouterConfig
    from deploy.ops.router.run import run, zenohd_text

    checked = load_config(config, RouterConfig, set_ or ())
    if zenohd is not None:
        with writing(zenohd):
            zenohd.write_text(zenohd_text(checked), "utf-8")
        return

    def write_figures(tree: dict[str, object]) -> None:
        if figures is not None:
            write_json(figures, tree)

    try:
        run_until_stopped(lambda stop: run(checked, stop, write_figures))
    except TandemError as error:
        raise TandemError(f"{config}: {error}") from None
