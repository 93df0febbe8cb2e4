"""`[tap]`: the socket at which local readers hear what this process hears, decides and sends."""

from __future__ import annotations

import socket
from pathlib import Path

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake

LONGEST = 100
"""Bytes of a Unix socket's path: the kernel takes 107."""


class TapConfig(Section):
    """`[tap]`."""

    socket: RelativePath | None = None
    """Path of the socket, such as /run/tandem/master.sock; None: there is no tap."""

    def mistakes(self) -> list[ConfigMistake]:
        """A path that a socket can have, on a system that has such sockets."""
        return [] if self.socket is None else socket_mistakes("tap.socket", self.socket)


def socket_mistakes(key: str, path: Path) -> list[ConfigMistake]:
    """Why no Unix socket can be at a path."""
    if not hasattr(socket, "AF_UNIX") or not hasattr(socket, "SO_PEERCRED"):
        return [ConfigMistake(key, str(path), "no socket: this system has none of this kind")]
    if len(str(path).encode()) > LONGEST:
        return [ConfigMistake(key, str(path), f"a path of at most {LONGEST} bytes")]
    if not path.parent.is_dir():
        return [ConfigMistake(key, str(path), "a path in a folder that exists")]
    return []
