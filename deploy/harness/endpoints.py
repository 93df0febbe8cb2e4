"""Free Zenoh endpoints and a free CAN port: on this machine, or on two emulated hosts."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from common.errors import ConfigError, ConfigMistake
from common.link.config import LinkConfig
from common.link.endpoint import SECURE, TRANSPORTS
from common.link.roles import Role
from deploy.harness.keys import MASTER, make_keys, tls_of
from deploy.sim.network import Network

PORT, MANAGEMENT_PORT, CAN_PORT = 7447, 7547, 43113
"""On emulated hosts, whose addresses are their own: the router and the robots on the link, everything on the
management network, the suit's bus."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Where each party listens: the robots for the master, the master and the observer for observers."""

    robots: tuple[str, ...]
    master: str
    observer: str
    can_port: int
    router: str = ""
    """Where the router listens; empty where master and robots reach each other directly."""
    keys: Path | None = None
    """The folder of their certificates; None for a transport that needs none."""
    watched: tuple[str, ...] = ()
    """Where each robot, or the router, listens for the observer; empty: where it does for the others."""

    @property
    def observing(self) -> LinkConfig:
        """The observer's link: commands from the master, states from each robot, truth at its own door."""
        everybody = (self.router,) if self.router else self.robots
        connect = [*(self.watched or everybody), *([] if self.router else [self.master])]
        tls = tls_of(self.keys, Role.OPERATOR, MASTER) if self.keys else None
        return LinkConfig(listen=[self.observer], connect=connect, tls=tls)

    def listening(self, number: int) -> list[str]:
        """Where the first, second … robot (0, 1 …) listens."""
        return [self.robots[number], *self.watched[number : number + 1]]


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
        ports = free_ports(transport, 2 + robots)
        router, master, *each = (f"{transport}/127.0.0.1:{port}" for port in ports)
    observer, can = free_port("tcp"), free_port("udp")
    door, through = f"tcp/127.0.0.1:{observer}", router if routed else ""
    keys = keys_for(transport, folder, [router, master, *each], robots)
    return Endpoints(tuple(each), master, door, can, through, keys)


def keys_for(transport: str, folder: Path, endpoints: list[str], robots: int) -> Path | None:
    """The folder of keys for these endpoints, made now; None for a transport that needs none."""
    names = [f"robot-{1 + number}" for number in range(robots)]
    return make_keys(folder, endpoints, names) if transport in SECURE else None


def network_endpoints(
    transport: str, network: Network, folder: Path, robots: int = 1, routed: bool = False
) -> Endpoints:
    """Endpoints on two hosts: only the messages between master and robots cross the emulated link.

    Observer, truth and requests use the management network. With a router, which runs on the operator's host,
    the observer's traffic with the robots crosses the link too, as clients know no other endpoint. Raises
    ConfigError for a transport that does not reach another host.
    """
    known = [each for each in TRANSPORTS if each != "unixsock-stream"]
    if transport not in known:
        files = "; a Unix socket is a file of one host" if transport == "unixsock-stream" else ""
        expected = f"one of {', '.join(known)}{files}"
        raise ConfigError("network", [ConfigMistake("transport", transport, expected)])
    operator, robot = network.operator, network.robot
    clean = "tls" if transport in SECURE else "tcp"
    each = [f"{transport}/{robot.address}:{PORT + 1 + number}" for number in range(robots)]
    master = f"{clean}/{operator.management}:{MANAGEMENT_PORT}"
    router = f"{transport}/{operator.address}:{PORT}"
    doors = [f"{clean}/{robot.management}:{MANAGEMENT_PORT + 1 + number}" for number in range(robots)]
    return Endpoints(
        robots=tuple(each),
        master=master,
        observer=f"tcp/{operator.caller}:{MANAGEMENT_PORT}",
        can_port=CAN_PORT,
        router=router if routed else "",
        keys=keys_for(transport, folder, [router, master, *each, *doors], robots),
        watched=(f"{clean}/{operator.management}:{PORT}",) if routed else tuple(doors),
    )


def free_port(transport: str) -> int:
    """A free port of this host."""
    return free_ports(transport, 1)[0]


def free_ports(transport: str, count: int) -> list[int]:
    """Several free ports, all different."""
    kind = socket.SOCK_DGRAM if transport in ("udp", "quic", "quic-datagram") else socket.SOCK_STREAM
    with ExitStack() as held:  # all at once, so that they differ
        probes = [held.enter_context(socket.socket(socket.AF_INET, kind)) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
