"""`tandem master` and `tandem slave`: the two processes of tandem."""

from __future__ import annotations

from common.config.load import load_config
from common.process.runtime import run as run_until_stopped
from deploy.report.options import ConfigFile, MetricsFile, Overrides
from deploy.report.output import metrics_writer


def master(config: ConfigFile, set_: Overrides = None, metrics: MetricsFile = None) -> None:
    """Run the operator's side: read the worn nodes, compute joint angles, send them to the robots.

    Example: `tandem master deploy/examples/master.toml`
    """
    from master.app import run
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))


def slave(config: ConfigFile, set_: Overrides = None, metrics: MetricsFile = None) -> None:
    """Run the robot's side: check every command, drive the servos, measure the latency.

    Example: `tandem slave deploy/examples/slave.toml`
    """
    from slave.app import run
    from slave.config import SlaveConfig

    checked = load_config(config, SlaveConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
