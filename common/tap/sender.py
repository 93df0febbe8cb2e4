"""The sender's side of the tap, in the event loop of a real-time process."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgpack

from common.clock import monotonic_ns
from common.errors import CodecError, TandemError
from common.process.stale_socket import remove_stale
from common.tap.config import TapConfig
from common.tap.message import GREETING, LONGEST, MOST_CHOSEN, TapMessage, decode_choice, encode

log = logging.getLogger(__name__)

READERS = 4
"""At once; each costs some 9 µs a message."""
_CREDENTIALS = struct.Struct("3i")


@dataclass(slots=True, eq=False)
class _Reader:
    """One process that reads."""

    socket: socket.socket
    pid: int
    number: int = 0
    refused: int = 0
    behind: bool = True
    """Lacks something that came before: owed a snapshot."""
    full: bool = False
    """Could not take the newest message."""
    chosen: tuple[str, ...] | None = None
    """How the topics begin that it wants; None: it wants all."""


class TapSender:
    """Hands messages to whoever reads the socket. Never blocks, never raises on a reader's account."""

    def __init__(self, path: Path, greeting: Callable[[], bytes]) -> None:
        """`greeting`: the first message of each reader, on the topic `GREETING`."""
        self.path = path
        self._greeting = greeting
        self._readers: list[_Reader] = []
        self._listener: socket.socket | None = None
        self.refused = 0
        """Messages that a reader was too slow for, over all readers since the start."""
        self.turned_away = 0
        """Processes that were one too many. Those of other users the socket's mode (0660) keeps out."""

    def open(self) -> None:
        """Begin to listen, in the running loop. Raises TandemError."""
        remove_stale(self.path, socket.SOCK_SEQPACKET, "[tap] socket")
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
        try:
            before = os.umask(0o117)  # 0660: the owner and its group
            try:
                listener.bind(str(self.path))
            finally:
                os.umask(before)
            listener.listen(READERS)
        except OSError as error:
            listener.close()
            raise TandemError(f"{self.path}: [tap] cannot listen there ({error.strerror or error})") from None
        self._listener = listener
        asyncio.get_running_loop().add_reader(listener, self._accept)

    def close(self) -> None:
        """End all readers and remove the socket."""
        if self._listener is None:
            return
        asyncio.get_running_loop().remove_reader(self._listener)
        for reader in list(self._readers):
            self._drop(reader, "")
        self._listener.close()
        self._listener = None
        with suppress(OSError):
            self.path.unlink()

    @property
    def read(self) -> bool:
        """Whether anybody reads everything: else nothing need be encoded for the tap alone."""
        return any(reader.chosen is None for reader in self._readers)

    @property
    def count(self) -> int:
        """How many read."""
        return len(self._readers)

    @property
    def behind(self) -> bool:
        """Whether a reader that reads lacks messages, so that it cannot go on without a snapshot.

        One that stands still is owed none before it reads again: a snapshot costs the loop milliseconds. One
        that chose its topics is owed none.
        """
        return any(reader.behind and not reader.full and reader.chosen is None for reader in self._readers)

    def put(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        """Hand one message to all readers that want it."""
        stamp_ns = monotonic_ns() if stamp_ns is None else stamp_ns
        for reader in tuple(self._readers):
            self._send(reader, topic, payload, stamp_ns)

    def put_snapshot(self, topic: str, payload: bytes) -> None:
        """Hand a snapshot to all readers: from it on, those that were behind can go on."""
        stamp_ns = monotonic_ns()
        for reader in tuple(self._readers):
            if self._send(reader, topic, payload, stamp_ns):
                reader.behind = False

    def _send(self, reader: _Reader, topic: str, payload: bytes, stamp_ns: int) -> bool:
        if reader.chosen is not None and not topic.startswith(reader.chosen):
            return True
        reader.number += 1
        try:
            reader.socket.send(encode(TapMessage(reader.number, topic, stamp_ns, payload)))
        except BlockingIOError:
            reader.refused += 1
            self.refused += 1
            reader.behind = reader.full = True
            return False
        except OSError as error:
            self._drop(reader, "" if isinstance(error, BrokenPipeError) else f": {error.strerror}")
            return False
        reader.full = False
        return True

    def _accept(self) -> None:
        if self._listener is None:
            return
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LONGEST)
        packed = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        pid, user, _ = _CREDENTIALS.unpack(packed)
        if len(self._readers) >= READERS:
            self.turned_away += 1
            log.warning("%s: process %d of user %d is turned away: %d read", self.path, pid, user, READERS)
            connection.close()
            return
        reader = _Reader(connection, pid)
        self._readers.append(reader)
        log.info("%s: process %d reads", self.path, pid)
        self._send(reader, GREETING, self._greeting(), monotonic_ns())
        if reader not in self._readers:
            return  # it has gone already
        asyncio.get_running_loop().add_reader(connection, self._hear, reader)
        self._hear(reader)  # one that chooses has often done so already

    def _hear(self, reader: _Reader) -> None:
        """A reader chose its topics, or has gone: its place is free at once, whatever topics it waits for."""
        try:
            asked = reader.socket.recv(MOST_CHOSEN)
            if not asked:
                self._drop(reader, "")
            elif reader.chosen is None:
                reader.chosen = decode_choice(asked)
            else:
                self._drop(reader, ": it chose twice")
        except BlockingIOError:
            return
        except (OSError, CodecError) as error:
            self._drop(reader, f": {error}")

    def _drop(self, reader: _Reader, why: str) -> None:
        if reader not in self._readers:
            return
        self._readers.remove(reader)
        asyncio.get_running_loop().remove_reader(reader.socket)
        reader.socket.close()
        log.info("%s: process %d has gone%s; %d messages refused", self.path, reader.pid, why, reader.refused)


def open_tap(config: TapConfig, greeting: Mapping[str, str]) -> TapSender | None:
    """The tap that a file asks for, listening; None where it asks for none. Raises TandemError."""
    if config.socket is None:
        return None
    packed: bytes = msgpack.packb(dict(greeting))
    sender = TapSender(config.socket, lambda: packed)
    sender.open()
    return sender
