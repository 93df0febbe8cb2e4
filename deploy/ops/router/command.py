"""`tandem router FILE`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import MetricsFile, Overrides
from deploy.report.output import in_a_folder, metrics_writer, writing


def router(
    config: Annotated[
        Path, typer.Argument(help="The router's TOML file; start from deploy/examples/router.toml.")
    ],
    set_: Overrides = None,
    zenohd: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.json5",
            help="Do not run: write the same rules as a configuration file for zenohd.",
            callback=in_a_folder,
        ),
    ] = None,
    metrics: MetricsFile = None,
) -> None:
    """Connect masters and robots that cannot reach each other, and enforce who may do what.

    Masters and robots connect to it with `[link] mode = "client"`. It reads all messages: run it on a
    host that you would trust to command the robots.

    Example: `tandem router deploy/examples/router.toml`
    """
    from common.link.router import RouterConfig
    from deploy.ops.router.run import run, zenohd_text

    checked = load_config(config, RouterConfig, set_ or ())
    if zenohd is not None:
        with writing(zenohd):
            zenohd.write_text(zenohd_text(checked), "utf-8")
        return

    try:
        run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
    except TandemError as error:
        raise TandemError(f"{config}: {error}") from None
