"""Prints the results of a command from a thread of its own, so that a blocked terminal delays no robot."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PrintLine = Callable[[str], None]
WAIT_S = 1.0
"""Time that the lines may take to be written after the command has ended."""

_acted = False


def acted() -> bool:
    """Whether this process commanded a robot: its exit status is then the command's, not the output's."""
    return _acted


@contextmanager
def line_printer() -> Iterator[PrintLine]:
    """A function that prints a line on standard output; it never blocks or raises.

    If the output is blocked (a paused terminal, a pipe that nobody reads), the process ends with the exit
    status of the command, and the lines that could not be written are lost.
    """
    global _acted
    _acted = True
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def write() -> None:
        while (line := lines.get()) is not None:
            sys.stdout.write(f"{line}\n")
            sys.stdout.flush()

    writer = threading.Thread(target=write, name="printer", daemon=True)
    writer.start()
    failed = True
    try:
        yield lines.put
        failed = False
    finally:
        lines.put(None)
        writer.join(WAIT_S)
        if writer.is_alive():
            # the thread holds the output's lock, and an interpreter that ends in order would wait for it
            os._exit(int(failed))
