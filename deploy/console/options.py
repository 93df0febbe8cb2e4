"""What the console serves, from its command line and from the files of master and slave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from common.config.console import ConsoleConfig
from common.config.load import check_config, load_config
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.client.destination import destination
from deploy.console.run import ConsoleOptions
from master.config import MasterConfig
from master.deadman.config import ConsoleHold


@dataclass(frozen=True, slots=True)
class ConsoleChoices:
    """What the command line says; None where it says nothing."""

    master: Path | None = None
    connect: Sequence[str] | None = None
    robots: Sequence[str] | None = None
    operator: str = ""
    tap: Path | None = None
    slave: Path | None = None
    listen: str | None = None
    profile: str | None = None
    certificate: Path | None = None
    overrides: Sequence[str] = ()
    """Of the master's file."""


def console_options(chosen: ConsoleChoices, on_ready: Callable[[str], None]) -> ConsoleOptions:
    """The command line wins over the files. Raises TandemError where something is missing or wrong."""
    where = destination(
        chosen.connect,
        chosen.robots,
        chosen.operator,
        chosen.master,
        chosen.certificate,
        overrides=chosen.overrides,
    )
    if not where.robots:
        raise TandemError("which robot? Name it by --robot, or the master's file by --master")
    file = None if chosen.master is None else load_config(chosen.master, MasterConfig, chosen.overrides)
    config = ConsoleConfig() if file is None else file.console
    if chosen.listen is not None:
        changed = {**config.model_dump(), "listen": chosen.listen}
        config = check_config(Path("command line"), changed, ConsoleConfig)
    hold = file.operator.deadman if file is not None else None
    zones = None
    if chosen.slave is not None:
        from slave.config import SlaveConfig  # loads MuJoCo

        zones = [zone.model_dump() for zone in load_config(chosen.slave, SlaveConfig).guard.zones]
    return ConsoleOptions(
        where,
        load_skeleton(chosen.profile or (file.profile if file is not None else "nursing")),
        config,
        tap=chosen.tap or (file.tap.socket if file is not None else None),
        deadman=None if hold is None else hold.source,
        deadman_socket=hold.socket if isinstance(hold, ConsoleHold) else None,
        zones=zones,
        on_ready=on_ready,
    )
