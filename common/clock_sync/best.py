"""The better of two bounds on the offset: half the round trip, or what both hosts' time services state. Pure.

With T the reference that both services follow, a_l = T − local clock and a_r = T − remote clock:

    θ = remote − local = a_l − a_r, within ± (error_l + error_r + ageing)

No symmetry of the way is assumed, so a line that is slow in one direction only is measured as it is. But a
statement is believed, not proved. The round trip proves limits of θ: a statement that contradicts them is
wrong, and none is believed for a while. A lie within the round trip's limits cannot be noticed.
"""

from __future__ import annotations

from common.clock import NS_PER_S, to_ms
from common.clock_sync.estimator import Offset
from common.clock_sync.reference import OLD_NS, interval_at
from common.wire.messages import ClockReference

DISTRUST_NS = 60 * NS_PER_S
"""After a contradiction."""
ROUND_TRIP = "round trip"


class BestOffset:
    """Chooses, and says why."""

    def __init__(self) -> None:
        self.contradictions = 0
        """Statements that the round trip refuted."""
        self.source = ROUND_TRIP
        """Whose bound is in use: `round trip`, `chrony`, `ptp`, or `chrony and ptp`."""
        self.words = "no exchange yet"
        """Which bound is in use, and why."""
        self._remote: ClockReference | None = None
        self._heard_ns = 0
        self._distrusted_until_ns: int | None = None
        self._refuted = ""
        self._judged: tuple[ClockReference, ClockReference] | None = None

    def heard(self, remote: ClockReference | None, now_ns: int) -> None:
        """What the other host states, as its newest message has it."""
        self._remote, self._heard_ns = remote, now_ns

    def estimate(self, now_ns: int, round_trip: Offset, own: ClockReference | None) -> Offset:
        """The offset by the narrower bound. `round_trip`: what the exchange measured."""
        stated, why = self._stated(now_ns, round_trip, own)
        half_trip = f"round trip ± {to_ms(round_trip.bound_ns):.3f} ms"
        if stated is None:
            return self._choose(ROUND_TRIP, f"half the round trip: {why}", round_trip)
        beside = f"± {to_ms(stated.bound_ns):.3f} ms stated by {why}"
        if stated.bound_ns < round_trip.bound_ns:
            return self._choose(why, f"{beside}; {half_trip}", stated)
        return self._choose(ROUND_TRIP, f"{half_trip}, narrower than {beside}", round_trip)

    def _choose(self, source: str, words: str, offset: Offset) -> Offset:
        self.source, self.words = source, words
        return offset

    def _stated(
        self, now_ns: int, round_trip: Offset, own: ClockReference | None
    ) -> tuple[Offset | None, str]:
        """The offset by both statements, and their sources; or None and why there is none."""
        remote = self._remote
        if not round_trip.trusted:
            return None, "the exchange is stale or too young"
        if own is None or now_ns - own.at_ns > OLD_NS:
            return None, "no time service here states its error"
        if remote is None or now_ns - self._heard_ns > OLD_NS:
            return None, "no time service on the other host states its error"
        if own.scale != remote.scale:
            return None, f"the two hosts follow different clocks ({own.scale}, {remote.scale})"
        stated = _combined(now_ns, round_trip, own, remote)
        beyond_ns = abs(stated.offset_ns - round_trip.offset_ns) - stated.bound_ns - round_trip.bound_ns
        if beyond_ns > 0:
            self._refute(now_ns, beyond_ns, own, remote)
        if self._distrusted_until_ns is not None and now_ns < self._distrusted_until_ns:
            return None, self._refuted
        return stated, _names(own, remote)

    def _refute(self, now_ns: int, beyond_ns: float, own: ClockReference, remote: ClockReference) -> None:
        if self._judged != (own, remote):  # each statement counts once
            self._judged = (own, remote)
            self.contradictions += 1
        self._distrusted_until_ns = now_ns + DISTRUST_NS
        beyond_ms = to_ms(beyond_ns)
        names = _names(own, remote)
        self._refuted = f"{names} is not believed: it contradicts the round trip by {beyond_ms:.1f} ms"


def _combined(now_ns: int, round_trip: Offset, own: ClockReference, remote: ClockReference) -> Offset:
    own_low, own_high = interval_at(own, now_ns)
    # the moment is known on the other host's clock as well as the round trip knows it
    low, high = interval_at(remote, round_trip.remote_ns(now_ns), round_trip.bound_ns)
    lowest, highest = own_low - high, own_high - low
    return Offset((lowest + highest) // 2, (highest - lowest) // 2 + 1, trusted=True)


def _names(own: ClockReference, remote: ClockReference) -> str:
    return own.source if own.source == remote.source else f"{own.source} and {remote.source}"
