"""Local Zenoh endpoints and a CAN port that nobody else on this machine uses."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from common.config import LinkConfig
from common.endpoint import SECURE, TRANSPORTS
from common.errors import ConfigError, ConfigMistake
from common.roles import Role
from deploy.rig.keys import OBSERVER, make_keys, tls_of


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Who listens where: each robot for the master, the master and the observer for those who watch."""

    robots: tuple[str, ...]
    master: str
    observer: str
    can_port: int
    router: str = ""
    """Where the router listens through which all goes; empty where they reach each other directly."""
    keys: Path | None = None
    """The folder of their certificates, where the transport needs some."""

    @property
    def observing(self) -> LinkConfig:
        """The observer's link: commands from the master, states from each robot, truth at its own door."""
        connect = [self.router] if self.router else [*self.robots, self.master]
        tls = tls_of(self.keys, Role.OBSERVER, OBSERVER) if self.keys else None
        return LinkConfig(listen=[self.observer], connect=connect, tls=tls)


def local_endpoints(transport: str, folder: Path, robots: int = 1, routed: bool = False) -> Endpoints:
    """Endpoints for one run, and the keys that they need.

    `routed`: with a router among them. Raises ConfigError for a transport that there is not.
    """
    if transport not in TRANSPORTS:
        known = ", ".join(TRANSPORTS)
        raise ConfigError("demo", [ConfigMistake("--transport", transport, f"one of {known}")])
    if transport == "unixsock-stream":
        names = ["router", "master", *(f"robot-{i + 1}" for i in range(robots))]
        router, master, *each = (f"{transport}/{folder / name}.sock" for name in names)
    else:
        ports = _free_ports(transport, 2 + robots)
        router, master, *each = (f"{transport}/127.0.0.1:{port}" for port in ports)
    [observer], [can] = _free_ports("tcp", 1), _free_ports("udp", 1)
    door, through = f"tcp/127.0.0.1:{observer}", router if routed else ""
    keys = keys_for(transport, folder, [router, master, *each], robots)
    return Endpoints(tuple(each), master, door, can, through, keys)


def keys_for(transport: str, folder: Path, endpoints: list[str], robots: int) -> Path | None:
    """The folder of keys for these endpoints, made now; None for a transport that needs none."""
    names = [f"robot-{1 + number}" for number in range(robots)]
    return make_keys(folder, endpoints, names) if transport in SECURE else None


def _free_ports(transport: str, count: int) -> list[int]:
    kind = socket.SOCK_DGRAM if transport in ("udp", "quic", "quic-datagram") else socket.SOCK_STREAM
    with ExitStack() as held:  # all at once, so that they differ
        probes = [held.enter_context(socket.socket(socket.AF_INET, kind)) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
