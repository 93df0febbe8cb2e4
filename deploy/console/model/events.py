"""What happened to a robot, newest last, for people. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from common.clock import to_s

KEPT = 50


@dataclass(frozen=True, slots=True)
class ShownEvent:
    """One line of the page's list."""

    number: int
    """Grows from event to event within this process."""
    at_ns: int
    what: str
    """`state`, `hold`, `stop`, `loss`, `clamp`, `node`, `link`, `act` or `alarm`."""
    text: str


class EventList:
    """The last `KEPT` events."""

    def __init__(self) -> None:
        self._events: deque[ShownEvent] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, what: str, text: str, now_ns: int) -> None:
        """Something happened."""
        self.count += 1
        self._events.append(ShownEvent(self.count, now_ns, what, text))

    def shown(self, now_ns: int) -> list[dict[str, object]]:
        """As the page has them."""
        return [
            {
                "id": event.number,
                "age_s": round(to_s(now_ns - event.at_ns), 1),
                "what": event.what,
                "text": event.text,
            }
            for event in self._events
        ]
