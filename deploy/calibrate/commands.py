"""`tandem calibrate`: the commands that work on a recording, one file each; `deploy/cli.py` adds `live`."""

from __future__ import annotations

import typer

from common.errors import TandemError
from deploy.calibrate.align import align
from deploy.calibrate.imu import imu
from deploy.calibrate.mag import mag
from deploy.calibrate.record import record

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Find the errors of the sensors and how each is turned against its segment; write them to TOML files.

    Example: `tandem calibrate live master.toml --out calibration`
    """


app.command("imu")(imu)
app.command("mag")(mag)
app.command("align")(align)
app.command("record")(record)


@app.command(
    "mount", hidden=True, context_settings={"ignore_unknown_options": True, "allow_extra_args": True}
)
def _mount() -> None:
    raise TandemError("`tandem calibrate mount` is now `tandem calibrate align`")
