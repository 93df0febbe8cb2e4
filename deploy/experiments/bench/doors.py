"""Doors to another process, there and back: tandem's link, bare Zenoh, a bare UDP socket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.link import open_link
from common.link.config import AccessConfig, LinkConfig
from common.link.roles import Role
from common.link.zenoh_config import zenoh_configuration
from common.wire.topics import COMMAND, STATE
from deploy.harness.keys import MASTER, tls_of

ROBOT = "bench"
THERE, BACK = "bench/there", "bench/back"

SendPing = Callable[[bytes], None]
"""Sends a payload; `on_echo(arrived_ns)` is called on the loop when it is back."""
OnEcho = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Door:
    """One way to reach the other process."""

    carrier: Literal["link", "zenoh", "udp"]
    """`link`: tandem's own. `zenoh`: bare, with the same configuration, and no event loop on the way."""
    endpoint: str
    """Where the echo listens, such as `tcp/127.0.0.1:7447`."""
    keys: Path | None = None
    """The folder of the keys that a secure transport needs; with rules, as docs/security.md sets hosts up."""

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        host, _, port = self.endpoint.partition("/")[2].rpartition(":")
        return host, int(port)

    def config(self, *, echoes: bool) -> LinkConfig:
        """The [link] of the side that echoes, or of the one that asks."""
        tree: dict[str, object] = {"listen" if echoes else "connect": [self.endpoint]}
        if self.keys is not None:
            role, name = (Role.ROBOT, ROBOT) if echoes else (Role.OPERATOR, MASTER)
            tree["tls"] = tls_of(self.keys, role, name)
            tree["access"] = AccessConfig(operators={MASTER: [ROBOT]})
        return LinkConfig.model_validate(tree)


@asynccontextmanager
async def open_ping(door: Door, on_echo: OnEcho) -> AsyncIterator[SendPing]:
    """The side that asks."""
    if door.carrier == "link":
        async with open_link(door.config(echoes=False), ROBOT) as link:
            link.subscribe(STATE, lambda _, arrived_ns: on_echo(arrived_ns))
            yield link.publish(COMMAND.of(MASTER))
    elif door.carrier == "zenoh":
        session = await asyncio.to_thread(_open_zenoh, door.config(echoes=False))
        held = _on_zenoh(session, BACK, on_echo)
        yield _publisher(session, THERE)
        # the session is not closed: that can hang on a peer that is gone, and the worker ends without it
        del held
    else:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _UdpPing(on_echo), remote_addr=door.address
        )
        yield transport.sendto
        transport.close()


@asynccontextmanager
async def open_echo(door: Door) -> AsyncIterator[None]:
    """The side that returns whatever comes, until the block ends."""
    if door.carrier == "link":
        async with open_link(door.config(echoes=True), ROBOT) as link:
            back = link.publish(STATE)
            link.subscribe(COMMAND, lambda payload, _: back(payload))
            yield
    elif door.carrier == "zenoh":
        session = _open_zenoh(door.config(echoes=True))
        put = _publisher(session, BACK)

        def on_sample(sample: zenoh.Sample) -> None:
            put(sample.payload.to_bytes())

        held = session.declare_subscriber(THERE, Callback(on_sample, indirect=False))
        yield
        del held
    else:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(_UdpEcho, local_addr=door.address)
        yield
        transport.close()


class _UdpPing(asyncio.DatagramProtocol):
    def __init__(self, on_echo: OnEcho) -> None:
        self._on_echo = on_echo

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._on_echo(monotonic_ns())

    def error_received(self, exc: Exception) -> None:
        """The other side is not up yet: the ping is asked again."""


class _UdpEcho(asyncio.DatagramProtocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # uvloop's transport is a DatagramTransport in all but its bases
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._transport.sendto(data, addr)


def _on_zenoh(session: zenoh.Session, key: str, on_echo: OnEcho) -> object:
    loop = asyncio.get_running_loop()

    def on_sample(sample: zenoh.Sample) -> None:
        arrived_ns = monotonic_ns()
        sample.payload.to_bytes()
        loop.call_soon_threadsafe(on_echo, arrived_ns)

    return session.declare_subscriber(key, Callback(on_sample, indirect=False))


def _open_zenoh(config: LinkConfig) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_configuration(config))))


def _publisher(session: zenoh.Session, key: str) -> SendPing:
    publisher = session.declare_publisher(
        key,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
        express=True,
        reliability=zenoh.Reliability.BEST_EFFORT,
    )
    put: SendPing = publisher.put
    return put
