"""`tandem drives`: the simulated drive network that a slave's file describes."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.process.runtime import run as run_until_stopped


def drives(
    config: Annotated[Path, typer.Argument(help="The slave's TOML file, for its [servos.canopen].")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set one key over the file.")
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=FAULT@SECONDS",
            help="Let a drive fail so long after the first SYNC: over-current, over-temperature, "
            "encoder-stuck, magnet-lost, parity, silent, restart, lost-turns, wrong-zero, wrong-gear, "
            "reversed, double-id, encoder-zero, runs-away, not-following, limit-active, local, no-voltage, "
            "warns, wrong-mode, position-stuck, or none, which ends what lasts.",
        ),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Write what was counted, as JSON, when stopped.", dir_okay=False)
    ] = None,
) -> None:
    """Run the simulated drives: CiA 402 drives as CANopen nodes that turn the simulated robot.

    Faults also on demand: write their number to object 2010h of a drive. The slave takes whoever does so
    for a second master, and stops.

    Example: `tandem drives deploy/examples/slave.toml --fault left_elbow_pitch=over-current@10`
    """
    from deploy.sim.drives.app import run
    from deploy.sim.drives.faults import planned
    from slave.config import SlaveConfig

    checked = load_config(config, SlaveConfig, ['servos.backend="canopen"', *(set_ or ())])
    faults = [planned(text, checked.skeleton) for text in fault or ()]
    counted: dict[str, object] = {}

    async def main(stop: asyncio.Event) -> None:
        counted.update(await run(checked, stop, faults))

    run_until_stopped(main)
    if figures is not None:
        figures.write_text(json.dumps(counted, ensure_ascii=False), "utf-8")
