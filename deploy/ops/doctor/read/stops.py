"""What a robot's emergency stop inputs tell at this moment."""

from __future__ import annotations

from dataclasses import dataclass

from common.process.extras import missing_extra
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.robot_stops import source_of

_OF_DRIVES = ("drive", "sto")


@dataclass(frozen=True, slots=True)
class StopRead:
    """One input."""

    config: StopInputConfig
    at_rest: bool | None = None
    """Whether its level is that of nobody pressing; None: not known."""
    why: str = ""
    """Why it is not known."""


def read_stops(estop: EstopConfig) -> list[StopRead]:
    """Open each input that is this host's own, read it once, and let go of it. Needs a running event loop."""
    return [StopRead(one) if one.source in _OF_DRIVES else _read(one) for one in estop.inputs]


def _read(config: StopInputConfig) -> StopRead:
    try:
        source = source_of(config, None)
    except ModuleNotFoundError as error:
        return StopRead(config, why=missing_extra(error) or str(error))
    source.start()
    level = source.read()
    source.stop()
    at_rest = None if level.on is None else level.on is config.on_at_rest
    return StopRead(config, at_rest, level.why)
