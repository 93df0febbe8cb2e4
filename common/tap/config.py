"""`[tap]`: the socket at which local readers hear what this process hears, decides and sends."""

from __future__ import annotations

import socket

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
        if self.socket is None:
            return []
        if not hasattr(socket, "AF_UNIX") or not hasattr(socket, "SO_PEERCRED"):
            return [ConfigMistake("tap.socket", str(self.socket), "no tap: this system has no such sockets")]
        if len(str(self.socket).encode()) > LONGEST:
            return [ConfigMistake("tap.socket", str(self.socket), f"a path of at most {LONGEST} bytes")]
        if not self.socket.parent.is_dir():
            return [ConfigMistake("tap.socket", str(self.socket), "a path in a folder that exists")]
        return []
