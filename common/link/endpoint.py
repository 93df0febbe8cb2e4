"""What a Zenoh endpoint may look like, checked before anything is opened."""

from __future__ import annotations

TRANSPORTS = ("tcp", "udp", "tls", "quic", "quic-datagram", "ws", "unixsock-stream")
"""An endpoint's first word. `quic-datagram` is ours: quic whose live messages travel as datagrams."""
SECURE = ("tls", "quic", "quic-datagram")
"""Encrypted, and each side shows a certificate."""
ABSENT = ("unixpipe", "vsock", "serial")
"""Protocols that Zenoh knows, but its Python package was built without."""
MAX_SOCKET_PATH = 107
"""Bytes in a Unix socket's path, by the kernel's `sun_path`."""


def transport_of(endpoint: str) -> str:
    """The endpoint's transport: quic told to be unreliable is `quic-datagram`, however it is written."""
    protocol, _, rest = endpoint.partition("/")
    metadata = rest.partition("#")[0].partition("?")[2].split(";")
    return "quic-datagram" if protocol == "quic" and "rel=0" in metadata else protocol


def for_zenoh(endpoint: str) -> str:
    """The endpoint in Zenoh's own words."""
    protocol, _, rest = endpoint.partition("/")
    if protocol != "quic-datagram":
        return endpoint
    address, sharp, options = rest.partition("#")
    return f"quic/{address}{';' if '?' in address else '?'}rel=0{sharp}{options}"


def check_endpoint(endpoint: str) -> str:
    """The endpoint itself, or ValueError saying what was expected.

    Form: `transport/host:port` or `unixsock-stream/path`, then optionally `?metadata` and `#options`.
    """
    protocol, slash, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    if protocol in ABSENT:
        others = ", ".join(TRANSPORTS)
        raise ValueError(f"expected a protocol out of {others}: {protocol} is not in Zenoh's Python package")
    if protocol not in TRANSPORTS or not slash:
        raise ValueError(f"expected a protocol out of {', '.join(TRANSPORTS)}, such as tcp/192.168.7.2:7447")
    if protocol == "unixsock-stream":
        if not 0 < len(address.encode()) <= MAX_SOCKET_PATH:
            raise ValueError(f"expected unixsock-stream/path with a path of 1 to {MAX_SOCKET_PATH} bytes")
        return endpoint
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isascii() and port.isdecimal() and 1 <= int(port) <= 65535):
        raise ValueError(f"expected {protocol}/host:port with a port of 1 to 65535")
    if protocol == "quic-datagram" and "rel=1" in rest:
        raise ValueError("expected quic/ with rel=1: quic-datagram/ is the one with rel=0")
    return endpoint
