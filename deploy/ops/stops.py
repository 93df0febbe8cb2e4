"""`tandem stops`: a robot's emergency stop inputs, live, while somebody presses them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from common.clock import monotonic_ns
from common.config.load import load_config
from common.errors import TandemError
from deploy.report.options import Overrides

if TYPE_CHECKING:
    from slave.stop_inputs.config import EstopConfig

PERIOD_S = 0.005
"""Of the servo loop, as configured by default."""


def stops(
    config: Annotated[Path, typer.Argument(help="The slave's TOML file; its [[estop.inputs]] are shown.")],
    set_: Overrides = None,
    seconds: Annotated[
        float | None, typer.Option(help="End after so long; otherwise with Ctrl-C.", min=0.0)
    ] = None,
) -> None:
    """Show each emergency stop input of this robot, live: press each one, and pull its plug.

    Stop the slave before, which holds the lines; inputs of drives are shown by `tandem status` instead.

    Example: `tandem stops /etc/tandem/robot.toml`
    """
    from slave.config import SlaveConfig

    estop = load_config(config, SlaveConfig, list(set_ or ())).estop
    own = [one for one in estop.inputs if one.source in ("gpio", "device")]
    for one in estop.inputs:
        if one not in own:
            typer.echo(
                f"{one.name} ({one.where}): told by the drive; watch `tandem status` while you press it"
            )
    if not own:
        raise TandemError(
            f"{config}: no [[estop.inputs]] with source gpio or device: none is this host's own"
        )
    asyncio.run(show(estop.model_copy(update={"inputs": own}), seconds, typer.echo))


async def show(estop: EstopConfig, seconds: float | None, say: Callable[[str], None]) -> None:
    """Say what each input tells, and whenever that changes."""
    from slave.stop_inputs.robot_stops import RobotStops

    inputs, told = RobotStops(estop, None), dict[str, str]()
    inputs.start()
    try:
        async with asyncio.timeout(seconds):
            while True:
                found = inputs.read(monotonic_ns())
                for one in estop.inputs:
                    words = found.get(one.name, f"{one.where}: closed, not pressed")
                    if told.get(one.name) != words:
                        told[one.name] = words
                        say(f"{'STOP' if one.name in found else 'ok  '}  {one.name} ({words})")
                await asyncio.sleep(PERIOD_S)
    except TimeoutError:
        return
    finally:
        inputs.stop()
