"""`tandem master` and `tandem slave`: the two processes of tandem."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import ConfigFile, MetricsFile, Overrides
from deploy.report.output import metrics_writer


def master(
    config: ConfigFile,
    set_: Overrides = None,
    metrics: MetricsFile = None,
    blinded: Annotated[
        Path | None,
        typer.Option(
            help="Key of a blinded study (`tandem session blind`), with --condition.", dir_okay=False
        ),
    ] = None,
    condition: Annotated[str, typer.Option(help="Code of the condition to run, such as K7.")] = "",
) -> None:
    """Run the operator's side: read the worn nodes, compute joint angles, send them to the robots.

    With --blinded, the key says where to connect, and neither the log nor an error names it.

    Example: `tandem master deploy/examples/master.toml`
    """
    from deploy.study.blind_run import connect_of, transports_hidden
    from master.app import run
    from master.config import MasterConfig

    if (blinded is None) != (not condition):
        raise TandemError("--blinded and --condition: expected both, or neither")
    if blinded is None:
        checked = load_config(config, MasterConfig, set_ or ())
        run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
        return
    connect = connect_of(blinded, condition)
    with transports_hidden():
        checked = load_config(config, MasterConfig, [*(set_ or ()), f"link.connect={json.dumps(connect)}"])
        if checked.link.listen:
            raise TandemError(
                f"{config}: link.listen: expected [] with --blinded: a robot could connect there over "
                "another transport than the condition's"
            )
        if checked.link.twin is not None:  # metrics and page name the path that is missing, by its endpoints
            raise TandemError(
                f"{config}: link.twin: expected no second path with --blinded, as it is not the condition's: "
                "take [link.twin] out"
            )
        run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))


def slave(config: ConfigFile, set_: Overrides = None, metrics: MetricsFile = None) -> None:
    """Run the robot's side: check every command, drive the servos, measure the latency.

    Example: `tandem slave deploy/examples/slave.toml`
    """
    from slave.app import run
    from slave.config import SlaveConfig

    checked = load_config(config, SlaveConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
