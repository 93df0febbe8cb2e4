"""What a process has declared in its Zenoh session, so that it can be declared again in a new one."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from typing import TypeVar

import zenoh

Declare = Callable[[zenoh.Session], object]
"""Declares something in a session and returns what keeps it declared."""

Event = TypeVar("Event")

log = logging.getLogger(__name__)


class Declarations:
    """One Zenoh session and all that is declared in it."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self._numbers = itertools.count()
        self._makers: dict[int, Declare] = {}
        self._held: dict[int, object] = {}

    def add(self, declare: Declare) -> int:
        """Declare it now, and in every session to come; its number, for `remove`."""
        number = next(self._numbers)
        self._held[number] = declare(self.session)
        self._makers[number] = declare
        return number

    def remove(self, number: int) -> None:
        """Declare it no more: the other sides need not send what nobody hears."""
        self._makers.pop(number, None)
        _undeclare(self._held.pop(number, None))

    def only_of(
        self,
        session: zenoh.Session,
        on_event: Callable[[Event], object],
        later: Callable[[Event], object] = lambda _: None,
    ) -> Callable[[Event], None]:
        """`on_event` as long as that session is in use, then `later`, which drops what is told.

        A session that does not close in time is left to itself. Who then goes in it has not gone in the new
        one, and would not come again there. And the rules by which it lets somebody in are the old ones.
        """

        def heard(event: Event) -> None:
            (on_event if self.session is session else later)(event)

        return heard

    def move(self, session: zenoh.Session) -> None:
        """Declare everything in another session; the old one is closed already."""
        self.session = session
        self._held = {number: declare(session) for number, declare in self._makers.items()}


def _undeclare(held: object) -> None:
    for each in held if isinstance(held, list | tuple) else (held,):
        undeclare = getattr(each, "undeclare", None)
        if undeclare is None:
            continue
        try:
            undeclare()
        except zenoh.ZError as error:  # the session is closed already
            log.debug("not undeclared: %s", error)
