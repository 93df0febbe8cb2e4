"""Local Zenoh endpoints and a CAN port that nobody else on this machine uses."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path

from common.config import LinkConfig
from common.errors import ConfigError, ConfigMistake

TRANSPORTS = ("tcp", "udp", "ws", "unixsock-stream")


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Who listens where: the robot for the master, the master and the observer for those who watch."""

    robot: str
    master: str
    observer: str
    can_port: int

    @property
    def observing(self) -> LinkConfig:
        """The observer's link: commands from the master, states from the robot, truth at its own door."""
        return LinkConfig(listen=[self.observer], connect=[self.robot, self.master])


def local_endpoints(transport: str, folder: Path) -> Endpoints:
    """Endpoints for one run. Raises ConfigError for a transport that the demo does not know."""
    if transport not in TRANSPORTS:
        known = ", ".join(TRANSPORTS)
        raise ConfigError("demo", [ConfigMistake("--transport", transport, f"one of {known}")])
    if transport == "unixsock-stream":
        robot, master = (f"{transport}/{folder / name}.sock" for name in ("robot", "master"))
    else:
        robot, master = (f"{transport}/127.0.0.1:{_free_port(transport)}" for _ in range(2))
    return Endpoints(robot, master, f"tcp/127.0.0.1:{_free_port('tcp')}", _free_port("udp"))


def _free_port(transport: str) -> int:
    kind = socket.SOCK_DGRAM if transport == "udp" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
