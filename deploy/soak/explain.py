"""From the events of a soak to the windows in which things may go wrong. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deploy.soak.events import Event, of_kind
from deploy.soak.samples import Samples
from deploy.soak.windows import Window, reason

HOST_STILL_MS = 50.0
"""Half of the guard's shortest time-out (its encoders', 0.1 s): a shorter stall explains no hold."""
LOST_PACKETS, LOST_WITHIN_S = 3, 1.5
"""A robot that misses three commands holds; a network that lost as many packets then explains it."""


@dataclass(frozen=True, slots=True)
class Explained:
    """Spans with a reason: starts and faults until the robot follows again, and the host's own stalls."""

    faults: tuple[Window, ...]
    stalls: tuple[Window, ...]
    """Of HOST_STILL_MS or longer."""
    network: tuple[Window, ...] = ()
    """Seconds in which nothing passed, as its profile says."""

    @property
    def all(self) -> tuple[Window, ...]:
        """All of them."""
        return (*self.faults, *self.stalls, *self.network)

    def still_s(self, from_s: float, until_s: float) -> float:
        """The longest of the host's stalls within a span, as far as it lies there."""
        spans = (min(w.until_s, until_s) - max(w.from_s, from_s) for w in self.stalls)
        return max(0.0, max(spans, default=0.0))

    def why(self, at_s: float) -> str:
        """The reason of something that was seen then; empty where it has none."""
        return reason(at_s, self.all)


def explanation(events: Sequence[Event], samples: Samples) -> Explained:
    """Read the windows off a soak's files. What begins and never ends lasts to the end."""
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
    out_s = samples.at_s[np.nan_to_num(samples["link_out"]) > 0.0]
    network = tuple(Window(at_s - 1.0, at_s, "the network let nothing pass") for at_s in out_s.tolist())
    return Explained((*own, *faults[len(own) :], *last), tuple(stalls), network)


def unexplained_lefts(events: Sequence[Event], samples: Samples, explained: Explained) -> list[Event]:
    """When the robot left off, and neither fault, host nor network accounts for it."""
    lefts = of_kind(events, "left")
    spans = (*explained.stalls, *explained.network)
    lost = np.nan_to_num(samples["link_lost"])
    return [
        left
        for left in lefts
        if not any(window.includes(left.at_s) for window in spans)
        and lost[np.abs(samples.at_s - left.at_s + 0.5) <= LOST_WITHIN_S].sum() < LOST_PACKETS
    ]


def _first(events: Sequence[Event], kind: str) -> float:
    return next((event.at_s for event in events if event.kind == kind), math.inf)
