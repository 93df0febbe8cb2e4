"""Which picture the operator had seen when they moved, and how old it was by then. Pure."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from common.clock_sync import Offset
from common.latency.durations import Durations
from common.latency.one_way import one_way_ns
from common.wire.messages import Command

_KEPT = 256
"""Pictures that are remembered: 20 s of them at the usual rate."""


@dataclass(frozen=True, slots=True)
class SeenPicture:
    """The newest picture that a command's master had seen."""

    number: int
    known_ns: int
    """When the slave learnt of it, slave's clock."""
    delay_ns: int | None
    """The picture's delay beyond the clocks' quickest exchange; None while that exchange is not trusted."""


class Sight:
    """Remembers when each picture was taken and sent. `sent` may be called from another thread."""

    def __init__(self) -> None:
        self._pictures: OrderedDict[int, tuple[int, int]] = OrderedDict()
        self._newest = 0
        self._lease = 0
        self.captured_ns: int | None = None
        """When the newest picture was taken that the lease's holder has; None where none came yet."""
        self.observation_age = Durations()
        """From a picture to the operator's posture that was sampled while it was the newest one seen."""
        self.transit = Durations()
        """From a picture sent to the master's receiving it."""

    def sent(self, number: int, captured_ns: int, sent_ns: int) -> None:
        """Remember a picture."""
        self._pictures[number] = (captured_ns, sent_ns)
        while len(self._pictures) > _KEPT:
            self._pictures.popitem(last=False)

    def on_command(self, command: Command, now_ns: int, offset: Offset) -> SeenPicture | None:
        """Take an accepted command; the picture that it acknowledges first, else None."""
        if command.lease != self._lease:
            self._lease, self.captured_ns = command.lease, None
        known = self._pictures.get(command.seen_frame)
        if known is None:
            return None
        captured_ns, sent_ns = known
        self.captured_ns = captured_ns
        to_master = offset.reversed()
        age_ns = one_way_ns(captured_ns, command.stamps.sampled_ns, to_master)
        if age_ns is not None:
            self.observation_age.record(age_ns)
        transit_ns = one_way_ns(sent_ns, command.seen_ns, to_master) if command.seen_ns else None
        if command.seen_frame <= self._newest:
            return None
        self._newest = command.seen_frame
        if transit_ns is not None:
            self.transit.record(transit_ns)
        # the bound is half the quickest round trip: what a packet takes that meets nothing on its way
        delay_ns = None if transit_ns is None else max(0, transit_ns - offset.bound_ns)
        return SeenPicture(command.seen_frame, now_ns, delay_ns)
