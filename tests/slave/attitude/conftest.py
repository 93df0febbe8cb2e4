"""A serial line that is two pseudo-terminals' ends: what is written to one side is read at the other."""

from __future__ import annotations

import os
import pty
import tty
from collections.abc import Iterator

import pytest


class Line:
    """The instrument's end, and the name of the robot's."""

    def __init__(self) -> None:
        self.end, self._held = pty.openpty()
        # raw, or the terminal makes of FF and of 0D what it likes
        tty.setraw(self.end)
        tty.setraw(self._held)
        self.port = os.ttyname(self._held)

    def send(self, data: bytes) -> None:
        os.write(self.end, data)

    def receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            data += os.read(self.end, count - len(data))
        return data

    def unplug(self) -> None:
        os.close(self.end)
        os.close(self._held)
        self.end = self._held = -1

    def close(self) -> None:
        if self.end >= 0:
            self.unplug()


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()
