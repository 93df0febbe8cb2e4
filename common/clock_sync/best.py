"""The better of two bounds on the offset: half the round trip, or what both hosts' time services state. Pure.

With T the reference that both services follow, a_l = T − local clock and a_r = T − remote clock:

    θ = remote − local = a_l − a_r, within ± (error_l + error_r + ageing)

No symmetry of the way is assumed, so a line that is slow in one direction only is measured as it is. But a
statement is believed, not proved. The round trip proves limits of θ: a statement that contradicts them is
wrong, and none is believed for a while. A lie within the round trip's limits cannot be noticed.

Two true estimates may differ by both bounds. Where the choice between them changes, the offset that is told
goes from one to the other slowly, and its bound is wider by what is left of the way: else latencies, and the
target of who predicts by them, would jump.
"""

from __future__ import annotations

from dataclasses import replace

from common.clock import NS_PER_S, to_ms
from common.clock_sync.estimator import Offset
from common.clock_sync.reference import OLD_NS, interval_at
from common.wire.messages import ClockReference

DISTRUST_NS = 60 * NS_PER_S
"""After a contradiction."""
ROUND_TRIP = "round trip"
SLEW_PPM = 5000
"""How fast the told offset goes to the chosen one: 5 ms a second, far below what anybody's motion shows."""


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
        self._told: tuple[int, Offset] | None = None
        """When an offset was told last, and which."""
        self._lead_ns = 0
        """What the told offset is above the chosen one."""

    def heard(self, remote: ClockReference | None, now_ns: int) -> None:
        """What the other host states, as its newest message has it."""
        self._remote, self._heard_ns = remote, now_ns

    def estimate(self, now_ns: int, round_trip: Offset, own: ClockReference | None) -> Offset:
        """The offset by the narrower bound. `round_trip`: what the exchange measured."""
        stated, why = self._stated(now_ns, round_trip, own)
        half_trip = f"round trip ± {to_ms(round_trip.bound_ns):.3f} ms"
        if stated is None:
            return self._choose(now_ns, ROUND_TRIP, f"half the round trip: {why}", round_trip)
        beside = f"± {to_ms(stated.bound_ns):.3f} ms stated by {why}"
        if stated.bound_ns < round_trip.bound_ns:
            return self._choose(now_ns, why, f"{beside}; {half_trip}", stated)
        return self._choose(now_ns, ROUND_TRIP, f"{half_trip}, narrower than {beside}", round_trip)

    def _choose(self, now_ns: int, source: str, words: str, chosen: Offset) -> Offset:
        changed, self.source, self.words = source != self.source, source, words
        if self._told is None or not chosen.trusted or not self._told[1].trusted:
            self._lead_ns = 0
        else:
            told_ns, told = self._told
            if changed:
                self._lead_ns = told.offset_ns - chosen.offset_ns
                if abs(self._lead_ns) > told.bound_ns + chosen.bound_ns:
                    self._lead_ns = 0  # one of them was wrong: nobody is to go slowly from there
            else:
                way_ns = max(0, now_ns - told_ns) * SLEW_PPM // 1_000_000
                left_ns = max(0, abs(self._lead_ns) - way_ns)
                self._lead_ns = left_ns if self._lead_ns > 0 else -left_ns
        offset = chosen
        if self._lead_ns:
            self.words = f"{to_ms(abs(self._lead_ns)):.1f} ms away, going there: {words}"
            offset = replace(
                chosen,
                offset_ns=chosen.offset_ns + self._lead_ns,
                bound_ns=chosen.bound_ns + abs(self._lead_ns),
            )
        self._told = now_ns, offset
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
