"""`tandem drives`: the simulated drive network that a slave's file describes."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.process.runtime import run as run_until_stopped
from deploy.report.options import MetricsFile, Overrides
from deploy.report.output import metrics_writer


def drives(
    config: Annotated[
        Path, typer.Argument(help="The slave's TOML file; its section [servos.canopen] describes the drives.")
    ],
    set_: Overrides = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=FAULT@SECONDS",
            help="Make a drive fail this many seconds after the first SYNC: over-current, over-temperature, "
            "encoder-stuck, magnet-lost, parity, silent, restart, lost-turns, wrong-zero, wrong-gear, "
            "reversed, double-id, encoder-zero, runs-away, not-following, limit-active, local, no-voltage, "
            "warns, wrong-mode, position-stuck, torque-silent, torque-stuck, or none, which ends a lasting "
            "fault.",
        ),
    ] = None,
    maker: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=KIND",
            help="Build a joint's drive as a maker would, with his objects and habits: epos, interpolating, "
            "fixed, segmented or reserved-bits. The joint then needs its own section in the file.",
        ),
    ] = None,
    metrics: MetricsFile = None,
) -> None:
    """Simulate the robot's drives: CiA 402 drives on CANopen buses, which move the simulated robot.

    To inject a fault while it runs, write its number to object 2010h of a drive. The slave takes the sender
    for a second master, and stops.

    Example: `tandem drives deploy/examples/slave.toml --fault left_elbow_pitch=over-current@10`
    """
    from deploy.sim.drives.app import run
    from deploy.sim.drives.faults import planned
    from deploy.sim.drives.makers import maker_of
    from slave.config import SlaveConfig

    checked = load_config(config, SlaveConfig, set_ or ())
    if not checked.servos.joints:
        checked = load_config(config, SlaveConfig, ['servos.backend="canopen"', *(set_ or ())])
    faults = [planned(text, checked.skeleton) for text in fault or ()]
    makers = dict(maker_of(text, checked.skeleton) for text in maker or ())

    async def main(stop: asyncio.Event) -> None:
        metrics_writer(metrics)(await run(checked, stop, faults, makers))

    run_until_stopped(main)
