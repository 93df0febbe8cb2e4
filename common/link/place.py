"""Which endpoints of this host a person would look for: addresses in place of "everywhere"."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import psutil

from common.link.config import LinkConfig

_EVERYWHERE = ("0.0.0.0", "[::]", "*")
_MOST = 3
"""Addresses named of a host that has many."""


def own_endpoints(config: LinkConfig) -> list[str]:
    """Where it listens, with this host's addresses; a session that only connects has just addresses."""
    if not config.listen:
        return _addresses()[:_MOST]
    return list(_spelled_out(config.listen))[: 2 * _MOST]


def _spelled_out(listen: list[str]) -> Iterator[str]:
    for endpoint in listen:
        transport, _, address = endpoint.partition("/")
        host, _, port = address.rpartition(":")
        if host in _EVERYWHERE:
            yield from (f"{transport}/{own}:{port}" for own in _addresses()[:_MOST])
        else:
            yield endpoint


def _addresses() -> list[str]:
    """IPv4 addresses of the host itself, the loopback's only where there is no other."""
    found = [
        entry.address
        for entries in psutil.net_if_addrs().values()
        for entry in entries
        if entry.family == socket.AF_INET
    ]
    return [each for each in found if not each.startswith("127.")] or found
