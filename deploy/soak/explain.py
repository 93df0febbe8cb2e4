"""From the events of a soak to the windows in which things may go wrong. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from deploy.soak.events import Event, of_kind
from deploy.soak.windows import Window, reason

HOST_STILL_MS = 50.0
"""Half of the guard's shortest time-out (its encoders', 0.1 s): a shorter stall explains no hold."""
TICK_MS = 5.0


@dataclass(frozen=True, slots=True)
class Explained:
    """Spans with a reason: starts and faults until the robot follows again, and the host's own stalls."""

    faults: tuple[Window, ...]
    stalls: tuple[Window, ...]
    """Of HOST_STILL_MS or longer."""

    @property
    def all(self) -> tuple[Window, ...]:
        """Both."""
        return (*self.faults, *self.stalls)

    def why(self, at_s: float) -> str:
        """The reason of something that was seen then; empty where it has none."""
        return reason(at_s, self.all)


def explanation(events: Sequence[Event]) -> Explained:
    """Read the windows off the events. What begins and never ends lasts to the end."""
    faults = [Window(0.0, _first(events, "follows"), "start")]
    for fault in of_kind(events, "fault"):
        number = fault.what.get("number")
        ends = [e.at_s for e in of_kind(events, "recovered") if e.what.get("number") == number]
        faults.append(Window(fault.at_s, ends[0] if ends else math.inf, str(fault.what.get("fault"))))
    stalls = [
        Window(e.what["from_s"], e.what["from_s"] + e.what["still_ms"] / 1e3, "the host stood still")
        for e in of_kind(events, "still")
        if e.what["still_ms"] >= HOST_STILL_MS
    ]
    own = tuple(faults)
    # what the robot does once it has left off by itself is of one cause; that it left is judged on its own
    for left in of_kind(events, "left"):
        ends = [e.at_s for e in of_kind(events, "recovered") if e.at_s > left.at_s]
        faults.append(Window(left.at_s, ends[0] if ends else math.inf, "after it left off"))
    last = [Window(e.at_s, math.inf, "end") for e in of_kind(events, "end")]
    return Explained((*own, *faults[len(own) :], *last), tuple(stalls))


def unexplained_lefts(events: Sequence[Event], explained: Explained) -> list[Event]:
    """When the robot left off without a fault, and the host had not stood still."""
    lefts = of_kind(events, "left")
    return [e for e in lefts if not any(w.includes(e.at_s) for w in explained.stalls)]


def _first(events: Sequence[Event], kind: str) -> float:
    return next((event.at_s for event in events if event.kind == kind), math.inf)
