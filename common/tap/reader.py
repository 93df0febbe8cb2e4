"""The reader's side of the tap, in the event loop of a process that may fall behind."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from common.errors import CodecError, TandemError
from common.tap.message import LONGEST, TapMessage, decode, encode_choice

AT_ONCE = 4
"""Messages: a tap at rest costs no turn of the loop, one that a reader lags behind does not keep the loop."""


class TapReader:
    """A connection to one process's tap; a context manager."""

    def __init__(self, path: Path, topics: Sequence[str] | None = None) -> None:
        """Connect. Raises TandemError where nobody listens or this user may not read.

        `topics`: how those begin that are wanted; None: all. Who chooses spares the sender all others, and
        is given no snapshot.
        """
        self.path = path
        self.missed = 0
        """Messages that this reader was too slow for."""
        self._next = 1
        self._at_once = 0
        """Messages in a row that were there already."""
        self._buffer = bytearray(LONGEST)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
        try:
            self._socket.connect(str(path))
            if topics is not None:
                self._socket.send(encode_choice(topics))
        except OSError as error:
            self._socket.close()
            raise TandemError(
                f"{path}: no tap there ({error.strerror}); is this the path in the process's [tap] socket?"
            ) from None

    async def read(self) -> TapMessage:
        """The next message. Raises TandemError once the process has gone, or speaks another version.

        Others of the loop run once in `AT_ONCE` messages at least, also where a busy tap always has the next.
        """
        if self._at_once >= AT_ONCE:
            self._at_once = 0
            await asyncio.sleep(0)  # before, not after: who is cancelled here has not lost a message
        try:
            size = self._receive()
            if size is None:
                self._at_once = 0
                size = await asyncio.get_running_loop().sock_recv_into(self._socket, self._buffer)
        except OSError as error:
            raise TandemError(f"{self.path}: the tap has failed ({error.strerror})") from None
        if not size:
            raise TandemError(f"{self.path}: the process has ended, or too many read it")
        try:
            message = decode(bytes(self._buffer[:size]))
        except CodecError as error:
            raise TandemError(f"{self.path}: {error}; is it a tap of this version?") from None
        self.missed += message.number - self._next
        self._next = message.number + 1
        return message

    def _receive(self) -> int | None:
        """The length of a message that is there already; None where none is."""
        try:
            size = self._socket.recv_into(self._buffer)
        except BlockingIOError:
            return None
        self._at_once += 1
        return size

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
