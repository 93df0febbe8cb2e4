"""A TCP path between two processes of this machine that a test can cut."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from deploy.harness.endpoints import free_port


class TcpPath:
    """A TCP path that can be cut: then nothing passes, and nobody is told."""

    def __init__(self, port: int) -> None:
        self.port, self._to = free_port("tcp"), port
        self._whole = asyncio.Event()
        self._whole.set()
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def cut(self) -> bool:
        """Whether nothing passes."""
        return not self._whole.is_set()

    @cut.setter
    def cut(self, cut: bool) -> None:
        (self._whole.clear if cut else self._whole.set)()

    @asynccontextmanager
    async def open(self) -> AsyncIterator[TcpPath]:
        """Carry what comes to `port`, until the end."""
        server = await asyncio.start_server(self._accept, "127.0.0.1", self.port)
        try:
            yield self
        finally:
            server.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            await asyncio.sleep(0)  # the sockets close at the loop's next turn

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            there_reader, there_writer = await asyncio.open_connection("127.0.0.1", self._to)
        except OSError:  # the robot's side has gone
            writer.transport.abort()
            return
        for source, target in ((reader, there_writer), (there_reader, writer)):
            self._tasks.add(asyncio.ensure_future(self._carry(source, target)))

    async def _carry(self, source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
        try:
            with suppress(OSError):
                while data := await source.read(65536):
                    await self._whole.wait()
                    target.write(data)
        finally:
            target.transport.abort()
