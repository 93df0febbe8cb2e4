"""A place for the newest value of each sender: a late reader finds the latest, and how many it missed."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

Value = TypeVar("Value")
MOST_KEYS = 64
"""Senders that are kept apart between two looks; what more of them send is counted and lost."""


class Mailbox(Generic[Value]):
    """Holds one value a key; a newer one overwrites it and is counted. Safe between threads, waits little.

    One sender's values never overwrite another's, so that a flood on one key does not silence the others.
    """

    def __init__(self, most_keys: int = MOST_KEYS) -> None:
        self._most_keys = most_keys
        self._lock = threading.Lock()
        self._slots: dict[str, Value] = {}
        self.overwritten = 0
        """Values that were replaced before they were taken, or that came on one key too many."""

    def put(self, key: str, value: Value) -> bool:
        """Leave a value. True if the box was empty, so that its reader must be woken."""
        with self._lock:
            was_empty = not self._slots
            if key in self._slots:
                self.overwritten += 1
                del self._slots[key]  # the newest comes last
            elif len(self._slots) >= self._most_keys:
                self.overwritten += 1
                return False
            self._slots[key] = value
        return was_empty

    def take(self) -> dict[str, Value]:
        """The newest value of each key, once, in the order of their arrival."""
        with self._lock:
            slots, self._slots = self._slots, {}
        return slots
