"""Which robots a person means, where they are, in whose name he asks: from options or the master's file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common.config import LinkConfig, check_config, load_config
from common.errors import TandemError
from master.config import MasterConfig


@dataclass(frozen=True, slots=True)
class Reach:
    """Endpoints to connect to, robots by name, and who asks."""

    link: LinkConfig
    robots: tuple[str, ...]
    """Empty where nobody named any."""
    operator: str = ""


def reach(
    connect: Sequence[str] | None,
    robots: Sequence[str] | None,
    operator: str = "",
    master: Path | None = None,
) -> Reach:
    """What the command line says; what it leaves out comes from the master's file, where one is named.

    Raises ConfigError for a file or an endpoint that is none, TandemError where no endpoint is known.
    """
    file = None if master is None else load_config(master, MasterConfig)
    endpoints = list(connect or (file.link.connect if file else ()))
    if not endpoints:
        raise TandemError(
            "where is the robot? Name its endpoint by --connect, or the master's file by --master"
        )
    link = check_config(Path("command line"), {"connect": endpoints}, LinkConfig)
    named = dict.fromkeys(robots or (file.commanded if file else ()))
    return Reach(link, tuple(named), operator or (file.operator.name if file else ""))
