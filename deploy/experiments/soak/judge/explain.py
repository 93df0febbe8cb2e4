"""Finds the windows of a soak in which a failure has a reason. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.experiments.soak.files.events import AnyEvent, SoakEvent, of_kind
from deploy.experiments.soak.files.happenings import (
    FaultBegun,
    FaultRecovered,
    HostStalled,
    RobotFollowed,
    RobotLeft,
    SoakBegun,
    SoakEnded,
)
from deploy.experiments.soak.files.samples import Samples
from deploy.experiments.soak.judge.windows import Window, explained, reason
from deploy.harness.excuse import STILL_S

LOST_WITHIN_S = 1.5
LEFT_OFF = "after it left track"
"""Explains what the robot does then, not why it left track."""
LOST_PACKETS = {"udp": 3, "quic-datagram": 3}
"""So many packets lost just before explain a hold. It takes three missed commands; on a stream, as all other
transports are, one packet holds up those behind it until it is sent again, 0.2 s later or more (RTO)."""


@dataclass(frozen=True, slots=True)
class Explained:
    """Spans with a reason: faults until the robot follows again, the host's stalls, the network's losses."""

    faults: tuple[Window, ...]
    stalls: tuple[Window, ...]
    """What of them is shown to be the host's (deploy/harness/excuse.py), of STILL_S or longer."""
    network: tuple[Window, ...]
    """Seconds in which it lost packets, turned or doubled them, or let nothing pass."""
    lossy_s: tuple[float, ...]
    """Middles of seconds in which it lost enough for a hold."""

    @property
    def all(self) -> tuple[Window, ...]:
        """All of them."""
        return (*self.faults, *self.stalls, *self.network)

    @property
    def causes(self) -> tuple[Window, ...]:
        """The windows that may be why the robot left track."""
        return tuple(window for window in self.all if window.why != LEFT_OFF)

    def still_s(self, from_s: float, until_s: float) -> float:
        """The longest of the host's stalls within a span, as far as it lies there."""
        spans = (min(w.until_s, until_s) - max(w.from_s, from_s) for w in self.stalls)
        return max(0.0, max(spans, default=0.0))

    def accounts_for_hold(self, at_s: float) -> bool:
        """Whether a host stall or network loss just before explains that the robot held."""
        return any(window.includes(at_s) for window in self.stalls) or any(
            abs(lossy_s - at_s) <= LOST_WITHIN_S for lossy_s in self.lossy_s
        )

    def accounted(self, at_s: Array) -> Mask:
        """(N,) times at which a hold would be put down to the host or the network."""
        near = np.zeros(len(at_s), np.bool_)
        if self.lossy_s:
            middles_s = np.sort(np.asarray(self.lossy_s))
            next_ = np.searchsorted(middles_s, at_s)
            before_s = at_s - middles_s[np.maximum(next_ - 1, 0)]
            after_s = middles_s[np.minimum(next_, len(middles_s) - 1)] - at_s
            near = np.minimum(np.abs(before_s), np.abs(after_s)) <= LOST_WITHIN_S
        return near | explained(at_s, self.stalls)

    def why(self, at_s: float) -> str:
        """The reason of something that was seen then; empty where it has none."""
        return reason(at_s, self.all)


def explanation(events: Sequence[AnyEvent], samples: Samples) -> Explained:
    """Read the windows off a soak's files. What begins and never ends lasts to the end."""
    faults = [Window(0.0, next((e.at_s for e in of_kind(events, RobotFollowed)), math.inf), "start")]
    for fault in of_kind(events, FaultBegun):
        number = fault.what.number
        ends = [e.at_s for e in of_kind(events, FaultRecovered) if e.what.number == number]
        faults.append(Window(fault.at_s, ends[0] if ends else math.inf, fault.what.fault))
    stalls = [
        window for event in of_kind(events, HostStalled) if (window := _excused(event.what)) is not None
    ]
    own = tuple(faults)
    # what the robot does after it left track has that as its cause; that it left is judged by itself
    for left in of_kind(events, RobotLeft):
        ends = [e.at_s for e in of_kind(events, FaultRecovered) if e.at_s > left.at_s]
        faults.append(Window(left.at_s, ends[0] if ends else math.inf, LEFT_OFF))
    last = [Window(e.at_s, math.inf, "end") for e in of_kind(events, SoakEnded)]
    return Explained((*own, *faults[len(own) :], *last), tuple(stalls), *_network(events, samples))


def _excused(still: HostStalled) -> Window | None:
    """The end of a stall, as far as it is shown to be the host's; None where that is too short for a hold."""
    # a soak that was recorded before the evidence was kept shows none
    excused_s = still.excused_ms / 1e3
    until_s = still.from_s + still.still_ms / 1e3
    why = f"the host stalled: {still.evidence}"
    return Window(until_s - excused_s, until_s, why) if excused_s >= STILL_S else None


def _network(events: Sequence[AnyEvent], samples: Samples) -> tuple[tuple[Window, ...], tuple[float, ...]]:
    lost, out, odd = (np.nan_to_num(samples[f"link_{what}"]) for what in ("lost", "out", "odd"))
    at_s, gone = samples.at_s, lost + out
    windows = [Window(end_s - 1.0, end_s, "the network") for end_s in at_s[gone + odd > 0.0].tolist()]
    begun = of_kind(events, SoakBegun)
    enough = LOST_PACKETS.get(begun[0].what.transport if begun else "", 1)
    padded = np.pad(gone, 1)
    near = padded[:-2] + gone + padded[2:]
    return tuple(windows), tuple((at_s[(near >= enough) & (gone > 0.0)] - 0.5).tolist())


def unexplained_lefts(events: Sequence[AnyEvent], explained: Explained) -> list[SoakEvent[RobotLeft]]:
    """When the robot left track, and neither fault, host nor network explains it."""
    return [left for left in of_kind(events, RobotLeft) if not explained.accounts_for_hold(left.at_s)]
