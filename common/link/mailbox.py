"""A place for the newest value of a live stream: a late reader finds the latest, and how many it missed."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Mailbox(Generic[Value]):
    """Holds one value; a newer one overwrites it and is counted. Safe between threads, never waits long."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._slot: tuple[Value] | None = None
        self.overwritten = 0
        """Values that were replaced before they were taken."""

    def put(self, value: Value) -> bool:
        """Leave a value. True if the box was empty, so that its reader must be woken."""
        with self._lock:
            was_empty = self._slot is None
            self._slot = (value,)
            if not was_empty:
                self.overwritten += 1
        return was_empty

    def take(self) -> Value | None:
        """The newest value, once; None where there is none."""
        with self._lock:
            slot, self._slot = self._slot, None
        return None if slot is None else slot[0]
