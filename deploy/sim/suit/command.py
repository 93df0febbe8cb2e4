"""`tandem suit`: the simulated suit."""

from __future__ import annotations

from common.config.load import load_config
from common.process.runtime import run as run_until_stopped
from deploy.report.options import ConfigFile, MetricsFile, Overrides
from deploy.report.output import metrics_writer


def suit(config: ConfigFile, set_: Overrides = None, metrics: MetricsFile = None) -> None:
    """Simulate the worn nodes: answer the master on a CAN bus as a real suit would.

    Example: `tandem suit deploy/examples/suit.toml --set 'motion="sweep"'`
    """
    from deploy.sim.suit.config import SuitConfig
    from deploy.sim.suit.process import run

    checked = load_config(config, SuitConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, metrics_writer(metrics)))
