"""`tandem calibrate`: the commands that work on a recording, one file each; `deploy/cli.py` adds `live`."""

from __future__ import annotations

import typer

from deploy.calibrate.imu import imu
from deploy.calibrate.mag import mag
from deploy.calibrate.mount import mount
from deploy.calibrate.record import record

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Find the sensors' errors and how they sit, and write them to TOML."""


app.command("imu")(imu)
app.command("mag")(mag)
app.command("mount")(mount)
app.command("record")(record)
