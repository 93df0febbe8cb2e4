"""What a process has declared in its Zenoh session, so that it can be declared again in a new one."""

from __future__ import annotations

from collections.abc import Callable

import zenoh

Declare = Callable[[zenoh.Session], object]
"""Declares something in a session and returns what keeps it declared."""


class Declarations:
    """One Zenoh session and all that is declared in it."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self._makers: list[Declare] = []
        self._held: list[object] = []

    def add(self, declare: Declare) -> None:
        """Declare it now, and in every session to come."""
        self._held.append(declare(self.session))
        self._makers.append(declare)

    def move(self, session: zenoh.Session) -> None:
        """Declare everything in another session; the old one is closed already."""
        self.session = session
        self._held = [declare(session) for declare in self._makers]
