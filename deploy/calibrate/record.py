"""`tandem calibrate record`: raw readings of all nodes from the bus into a file."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from deploy.report.options import Overrides

if TYPE_CHECKING:
    from master.config import MasterConfig

_PROGRESS_S = 0.2


def record(
    config: Annotated[
        Path,
        typer.Argument(metavar="MASTER.toml", help="The master's TOML file, which names nodes and buses."),
    ],
    out: Annotated[Path, typer.Option(help="New .mcap file to write.", dir_okay=False)],
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop after this many seconds; without it, stop with Ctrl-C.", min=0.1),
    ] = None,
    set_: Overrides = None,
) -> None:
    """Record the raw readings of all nodes until Ctrl-C, for `calibrate imu`, `mag` and `align`.

    Example: `tandem calibrate record deploy/examples/master.toml --out session.mcap --seconds 300`
    """
    from common.config.load import load_config
    from common.process.runtime import run as run_until_stopped
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    run_until_stopped(lambda stop: _record(checked, out, seconds, stop, Console(stderr=True)))


async def _record(
    config: MasterConfig, out: Path, seconds: float | None, stop: asyncio.Event, console: Console
) -> None:
    import numpy as np

    from common.errors import TandemError
    from common.process.realtime import enter_real_time
    from common.process.runtime import until_stopped
    from deploy.calibrate import capture as shared
    from master.suit.sweep import Sweep

    if out.suffix.lower() != ".mcap":
        raise TandemError(f"{out}: expected a name that ends in .mcap")
    enter_real_time(config.process.realtime_priority)
    nodes = shared.names(config)
    answered = np.zeros(len(nodes), dtype=np.int64)
    ticks = 0
    last = None if seconds is None else round(seconds * config.capture.rate_hz)

    def on_sweep(sweep: Sweep) -> None:
        nonlocal ticks
        answered[sweep.fresh] += 1
        shared.record(recorder, sweep)
        ticks += 1
        if last is not None and ticks >= last:
            stop.set()

    async def show_progress() -> None:
        with console.status("waiting for the suit") as status:
            while True:
                took_s = ticks / config.capture.rate_hz
                heard_nodes = shared.heard(answered.tolist(), nodes)
                status.update(f"recording, {took_s:6.1f} s: {heard_nodes} (Ctrl-C ends it)")
                await asyncio.sleep(_PROGRESS_S)

    async def work() -> None:
        showing = asyncio.create_task(show_progress())
        try:
            await shared.open_capture(config, on_sweep).run()
        finally:
            showing.cancel()

    recorder = shared.open_recorder(config, out)
    try:
        await until_stopped(stop, work())
    finally:
        await asyncio.to_thread(recorder.close)
    shared.check_written(recorder)
    if not answered.any():
        raise TandemError(f"{out}: no node answered; is the suit on, and the bus right?")
    took_s = ticks / config.capture.rate_hz
    console.print(f"{out}: {took_s:.1f} s; {shared.heard(answered.tolist(), nodes)}", highlight=False)
