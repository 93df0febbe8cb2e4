"""What is sent to one page: at most a window of it unacknowledged, then the newest alone. Pure.

A page that stands still would otherwise find the past in its socket's buffers, and show it as the present.
"""

from __future__ import annotations

from collections.abc import Callable

from common.clock import to_ms

WINDOW = 8
"""Messages that a page may owe an acknowledgement for."""
MOST_IN_ORDER = 4
"""Messages of one slot that may wait where each needs the one before it."""
_SMOOTH = 0.2
_REMEMBERED = 128
"""Messages of which it is known when they left."""

Make = Callable[[int], str | bytes]
"""Makes a message from its number."""


class Outbox:
    """Slots by name, such as `view` or a camera's; each holds the newest that has not left yet."""

    def __init__(self) -> None:
        self.number = 0
        """Of the newest message that left."""
        self.acknowledged = 0
        self.replaced = 0
        """Messages that a newer one replaced before they left."""
        self.page_ns: float | None = None
        """Half of the time from a message to its acknowledgement, smoothed."""
        self._waiting: dict[str, Make] = {}
        self._broken: set[str] = set()
        """Slots in order of which messages were dropped since one that begins."""
        self._left_ns: dict[int, int] = {}

    def offer(self, slot: str, make: Make) -> None:
        """Put a message in a slot, in place of the one that waits there."""
        self.replaced += slot in self._waiting
        self._waiting[slot] = make

    def offer_in_order(self, slot: str, number: int, make: Make, begins: bool) -> bool:
        """Put a message behind those of its slot: each needs the one before, but for one that begins.

        Where too many wait, all are dropped, and False says that nothing helps but one that begins.
        """
        waiting = [name for name in self._waiting if name.startswith(f"{slot} ")]
        if begins or len(waiting) >= MOST_IN_ORDER:
            for name in waiting:
                del self._waiting[name]
            self.replaced += len(waiting)
            self._broken.discard(slot)
        if not begins and (len(waiting) >= MOST_IN_ORDER or slot in self._broken):
            self._broken.add(slot)
            self.replaced += 1
            return False
        self._waiting[f"{slot} {number}"] = make
        return True

    def take(self, now_ns: int) -> str | bytes | None:
        """The next message to send now; None where none waits or the window is full."""
        if not self._waiting or self.number - self.acknowledged >= WINDOW:
            return None
        slot = next(iter(self._waiting))
        make = self._waiting.pop(slot)
        self.number += 1
        self._left_ns[self.number] = now_ns
        self._left_ns.pop(self.number - _REMEMBERED, None)
        return make(self.number)

    def acknowledge(self, number: int, now_ns: int) -> bool:
        """The page has processed all messages up to a number; False where that number never left."""
        if not 0 < number <= self.number:
            return False
        left_ns = self._left_ns.get(number)
        if left_ns is not None and number > self.acknowledged:
            half_ns = 0.5 * (now_ns - left_ns)
            before = half_ns if self.page_ns is None else self.page_ns
            self.page_ns = before + _SMOOTH * (half_ns - before)
        self.acknowledged = max(self.acknowledged, number)
        return True

    def left_ns(self, number: int) -> int | None:
        """When the message of that number left; None where it did not, or long ago."""
        return self._left_ns.get(number)

    def owes_since_ns(self) -> int | None:
        """When the oldest message left that is not acknowledged; None where all are."""
        return self._left_ns.get(self.acknowledged + 1)

    def clear(self) -> None:
        """Forget what waits."""
        self._waiting.clear()
        self._broken.clear()

    @property
    def page_ms(self) -> float | None:
        """`page_ns` for the page."""
        return None if self.page_ns is None else round(to_ms(self.page_ns), 1)
