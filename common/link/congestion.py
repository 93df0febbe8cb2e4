"""How this process's tcp sockets share a line. Zenoh leaves it to the host, whose choice is one for all.

On a line of 380 ms a host's bbr cost six silences a minute without any loss; reno and cubic cost none.
"""

from __future__ import annotations

import logging
import os
import socket
from contextlib import suppress
from pathlib import Path

from common.errors import LinkError

log = logging.getLogger(__name__)

_DESCRIPTORS = Path("/proc/self/fd")


def check_congestion_control(algorithm: str) -> None:
    """Raises LinkError where this host's kernel lacks the algorithm, or does not permit it."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            _set(probe, algorithm)
        except (OSError, AttributeError) as error:
            raise LinkError(
                f"link.tcp_congestion_control = {algorithm!r}: {error}; "
                f"`sysctl net.ipv4.tcp_available_congestion_control` lists the available algorithms, "
                f"`modprobe tcp_{algorithm}` may add it"
            ) from None


def set_congestion_control(algorithm: str) -> int:
    """Set it on each tcp socket of this process, also for what it accepts; how many sockets were set."""
    changed = 0
    for entry in os.listdir(_DESCRIPTORS):  # noqa: PTH208  # a descriptor may close while one looks
        with suppress(OSError), socket.socket(fileno=os.dup(int(entry))) as one:
            if one.type == socket.SOCK_STREAM and one.family in (socket.AF_INET, socket.AF_INET6):
                _set(one, algorithm)
                changed += 1
    return changed


def _set(one: socket.socket, algorithm: str) -> None:
    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, algorithm.encode("ascii"))
