"""What the console serves, from its command line and from the files of master and slave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from common.config.console import ConsoleConfig
from common.config.load import check_config, load_config
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.client.destination import destination
from deploy.client.own_door import own_doors
from deploy.console.calibration import CalibrationPlace
from deploy.console.model.robot import Side
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
    """Of the master's file; of the slave's where it stands alone."""


def console_options(chosen: ConsoleChoices, on_ready: Callable[[str], None]) -> ConsoleOptions:
    """The command line wins over the files. Raises TandemError where something is missing or wrong."""
    alone = chosen.slave is not None and chosen.master is None and not chosen.connect
    options = _at_the_robot(chosen) if alone else _at_the_operator(chosen)
    config = options.config
    if chosen.listen is not None:
        changed = {**config.model_dump(), "listen": chosen.listen}
        config = check_config(Path("command line"), changed, ConsoleConfig)
    return replace(options, config=config, on_ready=on_ready)


def _at_the_operator(chosen: ConsoleChoices) -> ConsoleOptions:
    """A console at the master's tap, or one that only knows endpoints."""
    where = destination(
        chosen.connect,
        chosen.robots,
        chosen.operator,
        chosen.master,
        chosen.certificate,
        overrides=chosen.overrides,
    )
    file = None if chosen.master is None else load_config(chosen.master, MasterConfig, chosen.overrides)
    if not where.robots and not (file is not None and file.watched):
        raise TandemError("which robot? Name it by --robot, or the master's file by --master")
    hold = file.operator.deadman if file is not None else None
    tap = chosen.tap or (file.tap.socket if file is not None else None)
    zones = None
    if chosen.slave is not None:
        from slave.config import SlaveConfig  # loads MuJoCo

        zones = [zone.model_dump() for zone in load_config(chosen.slave, SlaveConfig).guard.zones]
    return ConsoleOptions(
        where,
        load_skeleton(chosen.profile or (file.profile if file is not None else "nursing")),
        ConsoleConfig() if file is None else file.console,
        side=Side.ELSEWHERE if tap is None else Side.OPERATOR,
        tap=tap,
        deadman=None if hold is None else hold.source,
        deadman_socket=hold.socket if isinstance(hold, ConsoleHold) else None,
        zones=zones,
        recordings=None if file is None else file.recording.folder,
        calibration=_calibration(chosen, file, tap),
    )


def _calibration(
    chosen: ConsoleChoices, file: MasterConfig | None, tap: Path | None
) -> CalibrationPlace | None:
    """Where the operator's suit can be calibrated; None where something of it is not named."""
    if chosen.master is None or file is None or tap is None or file.console.calibration.folder is None:
        return None
    return CalibrationPlace(chosen.master, tap, file.console.calibration, chosen.overrides)


def _at_the_robot(chosen: ConsoleChoices) -> ConsoleOptions:
    """A console on the slave's host, for those who stand by the robot."""
    from slave.config import SlaveConfig

    assert chosen.slave is not None
    file = load_config(chosen.slave, SlaveConfig, chosen.overrides)
    where = own_doors(chosen.slave, file.link, file.robot, chosen.operator)
    tap = chosen.tap or file.tap.socket
    if tap is None and not where.link.connect:
        raise TandemError(f"{chosen.slave}: name [tap] socket, so that the console can hear the robot")
    return ConsoleOptions(
        where,
        file.skeleton,
        file.console,
        side=Side.ROBOT,
        tap=tap,
        zones=[zone.model_dump() for zone in file.guard.zones],
        recordings=file.recording.folder,
    )
