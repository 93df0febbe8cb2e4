"""Tells a person what an act did, by its own thread: no robot waits for a terminal that takes nothing."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Say = Callable[[str], None]
WAIT_S = 1.0
"""How long, after the act, its words may still take to be written."""

_acted = False


def acted() -> bool:
    """Whether this process carried out an act: its exit status then tells of the act, not of the output."""
    return _acted


@contextmanager
def telling() -> Iterator[Say]:
    """A function that says a line on standard output; it never blocks or raises.

    Where the output takes nothing (a terminal that is paused, a pipe that nobody reads) the process ends as
    the act did, with what could not be said left unsaid.
    """
    global _acted
    _acted = True
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def write() -> None:
        while (line := lines.get()) is not None:
            sys.stdout.write(f"{line}\n")
            sys.stdout.flush()

    writer = threading.Thread(target=write, name="teller", daemon=True)
    writer.start()
    failed = True
    try:
        yield lines.put
        failed = False
    finally:
        lines.put(None)
        writer.join(WAIT_S)
        if writer.is_alive():
            # it holds the output's lock, and an interpreter that ends in order would wait for that
            os._exit(int(failed))
