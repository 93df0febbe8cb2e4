"""`tandem suit`: the simulated suit."""

from __future__ import annotations

import typer

from common.config.load import load_config
from common.process.runtime import run as run_until_stopped
from deploy.report.group import SimulateByDefault
from deploy.report.options import ConfigFile, MetricsFile, Overrides
from deploy.report.output import metrics_writer

app = typer.Typer(
    cls=SimulateByDefault,
    no_args_is_help=True,
    help="The worn nodes: simulate them (`tandem suit FILE`), or check those on a bus (`tandem suit check`).",
)


@app.command("simulate")
def suit(config: ConfigFile, set_: Overrides = None, metrics: MetricsFile = None) -> None:
    """Simulate the worn nodes: answer the master on a CAN bus as a real suit would.

    Example: `tandem suit deploy/examples/suit.toml --set 'motion="sweep"'`
    """
    from deploy.sim.suit.config import SuitConfig
    from deploy.sim.suit.process import run

    checked = load_config(config, SuitConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
