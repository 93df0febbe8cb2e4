"""Whether a process answers where this host connects, and whether this host can listen where it should."""

from __future__ import annotations

import asyncio
import errno
import socket
from dataclasses import dataclass
from enum import StrEnum

from common.link.endpoint import transport_of

TIMEOUT_S = 2.0
_STREAMS = ("tcp", "tls", "ws")


class EndpointState(StrEnum):
    """What became of knocking at an endpoint, or of taking it."""

    ACCEPTS = "accepts"
    REFUSED = "refused"
    """The host is there, and nobody listens."""
    SILENT = "silent"
    UNKNOWN = "unknown"
    """No such host name, or no way to it."""
    NOT_ASKED = "not asked"
    """A datagram transport: nobody answers a knock."""
    FREE = "free"
    TAKEN = "taken"
    FOREIGN = "foreign"
    """Not an address of this host."""
    FORBIDDEN = "forbidden"


@dataclass(frozen=True, slots=True)
class EndpointFacts:
    """One endpoint."""

    endpoint: str
    answer: EndpointState


def _host_and_port(endpoint: str) -> tuple[str, int]:
    address = endpoint.partition("/")[2].partition("?")[0].partition("#")[0]
    host, _, port = address.rpartition(":")
    return host.strip("[]"), int(port)


async def knock(endpoint: str, timeout_s: float = TIMEOUT_S) -> EndpointFacts:
    """Open a connection and close it: no more than the endpoint's port is asked."""
    transport = transport_of(endpoint)
    if transport not in _STREAMS:
        return EndpointFacts(endpoint, EndpointState.NOT_ASKED)
    try:
        async with asyncio.timeout(timeout_s):
            _, writer = await asyncio.open_connection(*_host_and_port(endpoint))
    except TimeoutError:
        return EndpointFacts(endpoint, EndpointState.SILENT)
    except ConnectionRefusedError:
        return EndpointFacts(endpoint, EndpointState.REFUSED)
    except OSError:
        return EndpointFacts(endpoint, EndpointState.UNKNOWN)
    writer.close()
    return EndpointFacts(endpoint, EndpointState.ACCEPTS)


def try_to_listen(endpoint: str) -> EndpointFacts:
    """Take the endpoint's port for a moment."""
    transport = transport_of(endpoint)
    if transport == "unixsock-stream":
        return EndpointFacts(endpoint, EndpointState.FREE)  # Zenoh takes over what a dead process has left
    host, port = _host_and_port(endpoint)
    kind = socket.SOCK_STREAM if transport in _STREAMS else socket.SOCK_DGRAM
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=kind)[0]
        with socket.socket(family, kind) as probe:
            if kind == socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        answers = {errno.EADDRINUSE: EndpointState.TAKEN, errno.EACCES: EndpointState.FORBIDDEN}
        return EndpointFacts(endpoint, answers.get(error.errno or 0, EndpointState.FOREIGN))
    return EndpointFacts(endpoint, EndpointState.FREE)
