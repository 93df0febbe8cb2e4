"""Local Zenoh endpoints and a CAN port that nobody else on this machine uses."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from common.config import LinkConfig
from common.errors import ConfigError, ConfigMistake

TRANSPORTS = ("tcp", "udp", "ws", "unixsock-stream")


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Who listens where: each robot for the master, the master and the observer for those who watch."""

    robots: tuple[str, ...]
    master: str
    observer: str
    can_port: int

    @property
    def observing(self) -> LinkConfig:
        """The observer's link: commands from the master, states from each robot, truth at its own door."""
        return LinkConfig(listen=[self.observer], connect=[*self.robots, self.master])


def local_endpoints(transport: str, folder: Path, robots: int = 1) -> Endpoints:
    """Endpoints for one run. Raises ConfigError for a transport that the demo does not know."""
    if transport not in TRANSPORTS:
        known = ", ".join(TRANSPORTS)
        raise ConfigError("demo", [ConfigMistake("--transport", transport, f"one of {known}")])
    if transport == "unixsock-stream":
        names = ["master", *(f"robot-{i + 1}" for i in range(robots))]
        master, *each = (f"{transport}/{folder / name}.sock" for name in names)
    else:
        ports = _free_ports(transport, 1 + robots)
        master, *each = (f"{transport}/127.0.0.1:{port}" for port in ports)
    [observer], [can] = _free_ports("tcp", 1), _free_ports("udp", 1)
    return Endpoints(tuple(each), master, f"tcp/127.0.0.1:{observer}", can)


def _free_ports(transport: str, count: int) -> list[int]:
    kind = socket.SOCK_DGRAM if transport == "udp" else socket.SOCK_STREAM
    with ExitStack() as held:  # all at once, so that they differ
        probes = [held.enter_context(socket.socket(socket.AF_INET, kind)) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
