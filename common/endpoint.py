"""What a Zenoh endpoint may look like, checked before anything is opened."""

from __future__ import annotations

PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream")
"""The protocols of the Zenoh wheel; all but tls and quic are tested with a real session."""
MAX_SOCKET_PATH = 107
"""Bytes in a Unix socket's path, by the kernel's `sun_path`."""


def check_endpoint(endpoint: str) -> str:
    """The endpoint itself, or ValueError saying what was expected.

    Form: `protocol/host:port` or `unixsock-stream/path`, then optionally `?metadata` and `#options`.
    """
    protocol, slash, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    if protocol not in PROTOCOLS or not slash:
        raise ValueError(f"expected a protocol out of {', '.join(PROTOCOLS)}, such as tcp/192.168.7.2:7447")
    if protocol == "unixsock-stream":
        if not 0 < len(address.encode()) <= MAX_SOCKET_PATH:
            raise ValueError(f"expected unixsock-stream/path with a path of 1 to {MAX_SOCKET_PATH} bytes")
        return endpoint
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isascii() and port.isdecimal() and 1 <= int(port) <= 65535):
        raise ValueError(f"expected {protocol}/host:port with a port of 1 to 65535")
    return endpoint
