"""What the console serves, from its command line and from the files of master and slave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from common.config.console import ConsoleConfig
from common.config.load import check_config, load_config
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.client.destination import destination
from deploy.console.run import ConsoleOptions
from master.config import MasterConfig
from master.deadman.config import ConsoleHold
from slave.config import SlaveConfig


def console_options(
    master: Path | None,
    connect: Sequence[str] | None,
    robot: Sequence[str] | None,
    operator: str,
    tap: Path | None,
    slave: Path | None,
    listen: str | None,
    profile: str | None,
    certificate: Path | None,
    *,
    on_ready: Callable[[str], None],
) -> ConsoleOptions:
    """The command line wins over the files. Raises TandemError where something is missing or wrong."""
    where = destination(connect, robot, operator, master, certificate)
    if not where.robots:
        raise TandemError("which robot? Name it by --robot, or the master's file by --master")
    file = None if master is None else load_config(master, MasterConfig)
    config = ConsoleConfig() if file is None else file.console
    if listen is not None:
        config = check_config(Path("command line"), {**config.model_dump(), "listen": listen}, ConsoleConfig)
    hold = file.operator.deadman if file is not None else None
    return ConsoleOptions(
        where,
        load_skeleton(profile or (file.profile if file is not None else "nursing")),
        config,
        tap=tap or (file.tap.socket if file is not None else None),
        deadman=None if hold is None else hold.source,
        deadman_socket=hold.socket if isinstance(hold, ConsoleHold) else None,
        zones=None
        if slave is None
        else [zone.model_dump() for zone in load_config(slave, SlaveConfig).guard.zones],
        on_ready=on_ready,
    )
