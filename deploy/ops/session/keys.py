"""The keys of whoever leads a session, at a terminal: the next step, an event, the end."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

NEXT, EVENT, END = (" ", "\r", "\n"), ("m",), ("q",)


@contextmanager
def single_keys(take: Callable[[str], None]) -> Iterator[bool]:
    """Hand each key over as it is pressed; False where there is no terminal. In a running event loop."""
    if not sys.stdin.isatty():
        yield False
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    loop = asyncio.get_running_loop()
    tty.setcbreak(descriptor)
    loop.add_reader(descriptor, lambda: take(os.read(descriptor, 1).decode(errors="ignore")))
    try:
        yield True
    finally:
        loop.remove_reader(descriptor)
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
