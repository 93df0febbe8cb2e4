"""How far another host's monotonic clock is ahead of ours, and within what bound. Pure.

From the four stamps of an exchange: ours t1 (sent) and t4 (heard), theirs t2 (received) and t3 (sent).
Neither way takes less than no time, so at t4 the offset θ = theirs − ours obeys

    t3 − t4 − ρ(t4 − t1)  ≤  θ  ≤  t2 − t1 + ρ(t4 − t1)

where ρ is the most that the two clocks drift apart (NTP: RFC 5905, section 8). That is certain, not likely:
no symmetry is assumed. The two limits are kept apart, for each way has its own best exchange: when only the
way there becomes slow, only the upper limit becomes worse.

A limit ages: it widens by the rate at which the clocks may run apart, and stays in use until a newer exchange
says more. So a line that becomes slow for good does not make the offset unknown.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from common.clock import NS_PER_S, to_ns

UNKNOWN_NS = 1 << 62
"""The bound where nothing is known: 146 years."""
STEERED_PPM = 100_000.0
"""A clock that is steered may be this wrong: Linux slews CLOCK_MONOTONIC by up to 10 % (adjtimex's tick)."""
_ROUNDING_NS = 2
_STEERED_NS = 600 * NS_PER_S
"""How long a clock that broke its law is allowed the rate at which it did."""


@dataclass(frozen=True, slots=True)
class RateLaw:
    """How fast two clocks may run apart."""

    max_ppm: float
    """At any moment."""
    wander_ppm: float
    """By how much the rate at any moment may differ from its mean over any stretch of the last hour."""


RAW_CLOCKS = RateLaw(max_ppm=500.0, wander_ppm=20.0)
"""Two oscillators, not steered: each within 250 ppm, and room temperature changes them by some ppm."""
ANY_CLOCKS = RateLaw(max_ppm=2 * STEERED_PPM, wander_ppm=4 * STEERED_PPM)
"""Two clocks that may both be steered, at any moment."""


@dataclass(frozen=True, slots=True)
class Offset:
    """Another host's clock against ours, at one instant."""

    offset_ns: int
    """Remote minus local."""
    bound_ns: int
    """Half-width: the truth lies within offset ± bound."""
    trusted: bool
    """Measured often enough, and lately."""

    def local_ns(self, remote_ns: int) -> int:
        """A stamp of the remote clock, on ours."""
        return remote_ns - self.offset_ns

    def remote_ns(self, local_ns: int) -> int:
        """A stamp of our clock, on the remote one."""
        return local_ns + self.offset_ns

    def reversed(self) -> Offset:
        """Our clock against the other host's."""
        return Offset(-self.offset_ns, self.bound_ns, self.trusted)


NEVER_MEASURED = Offset(0, UNKNOWN_NS, trusted=False)


@dataclass(frozen=True, slots=True)
class _Point:
    """What one exchange says: at `at_ns` (ours) the offset was between the two limits."""

    at_ns: int
    lower_ns: float
    upper_ns: float
    round_trip_ns: int

    @property
    def width_ns(self) -> float:
        return self.upper_ns - self.lower_ns


@dataclass(frozen=True, slots=True)
class _Rates:
    """Between which rates the remote clock gains on ours, ns per ns."""

    lowest: float
    highest: float

    def __and__(self, other: _Rates) -> _Rates:
        return _Rates(max(self.lowest, other.lowest), min(self.highest, other.highest))


class OffsetEstimator:
    """Keeps the exchanges that say most of the offset, and the drift between the clocks that they prove.

    Times are ns of the local monotonic clock.
    """

    def __init__(
        self,
        law: RateLaw = ANY_CLOCKS,
        window_s: float = 60.0,
        parts: int = 30,
        stale_after_s: float = 5.0,
        trusted_from: int = 3,
    ) -> None:
        """`window_s`, `parts`: the shortest round trip of each part of the window is kept."""
        self._law = law
        self._part_ns = to_ns(window_s / parts)
        self._parts = parts
        self._stale_after_ns = to_ns(stale_after_s)
        self._trusted_from = trusted_from
        self.refused = 0
        """Exchanges with stamps that cannot be, such as a round trip below zero."""
        self.steps = 0
        """Times that the remote clock moved by more than its law allows, and all was forgotten."""
        self._steered_until_ns = 0
        self._steered = 0.0
        self._forget()

    def _forget(self) -> None:
        self._best: dict[int, _Point] = {}
        self._older: deque[_Point] = deque(maxlen=60)
        self._lower: _Point | None = None
        self._upper: _Point | None = None
        self._proved: deque[tuple[int, _Rates]] = deque(maxlen=60)
        self._rates = _Rates(-self._max_drift(0), self._max_drift(0))
        self._exchanges = 0
        self._newest_ns = 0

    def add(
        self, local_sent_ns: int, remote_received_ns: int, remote_sent_ns: int, local_received_ns: int
    ) -> bool:
        """Take the four stamps t1, t2, t3, t4 of an exchange; False if they are impossible."""
        away_ns = local_received_ns - local_sent_ns
        held_ns = remote_sent_ns - remote_received_ns
        apart_ns = self._max_drift(local_received_ns) * away_ns + _ROUNDING_NS
        lower_ns = remote_sent_ns - local_received_ns - apart_ns
        upper_ns = remote_received_ns - local_sent_ns + apart_ns
        if away_ns < 0 or held_ns < 0 or upper_ns < lower_ns or local_received_ns < self._newest_ns:
            self.refused += 1
            return False
        point = _Point(local_received_ns, lower_ns, upper_ns, max(away_ns - held_ns, 0))
        beyond_ns = self._beyond_ns(point)
        if beyond_ns > 0:
            self._break_law(point, beyond_ns)
        self._exchanges += 1
        self._newest_ns = local_received_ns
        self._keep(point)
        return True

    def estimate(self, now_ns: int) -> Offset:
        """The offset now, its bound, and whether it may be relied on."""
        limits = self._limits(now_ns)
        if limits is None:
            return NEVER_MEASURED
        lower_ns, upper_ns = limits
        fresh = now_ns - self._newest_ns <= self._stale_after_ns
        return Offset(
            round((lower_ns + upper_ns) / 2),
            round((upper_ns - lower_ns) / 2) + _ROUNDING_NS,
            trusted=fresh and self._exchanges >= self._trusted_from,
        )

    @property
    def round_trip_ns(self) -> int | None:
        """The shortest round trip of the window."""
        return min((p.round_trip_ns for p in self._best.values()), default=None)

    def _limits(self, now_ns: int) -> tuple[float, float] | None:
        if self._lower is None or self._upper is None:
            return None
        rates = self._rates
        since_lower, since_upper = now_ns - self._lower.at_ns, now_ns - self._upper.at_ns
        return (
            self._lower.lower_ns + min(rates.lowest * since_lower, rates.highest * since_lower),
            self._upper.upper_ns + max(rates.lowest * since_upper, rates.highest * since_upper),
        )

    def _max_drift(self, now_ns: int) -> float:
        law = self._law.max_ppm * 1e-6
        return max(law, self._steered) if now_ns < self._steered_until_ns else law

    def _wander(self, now_ns: int) -> float:
        # what broke the law once is steered: its past rate says nothing of the next moment's
        return 2 * self._max_drift(now_ns) if now_ns < self._steered_until_ns else self._law.wander_ppm * 1e-6

    def _beyond_ns(self, point: _Point) -> float:
        """By how much an exchange contradicts all before it; 0 where it does not."""
        limits = self._limits(point.at_ns)
        if limits is None:
            return 0.0
        return max(0.0, point.lower_ns - limits[1], limits[0] - point.upper_ns)

    def _break_law(self, point: _Point, beyond_ns: float) -> None:
        """Begin anew; a clock that is steered, rather than set, is allowed twice that rate for a while."""
        since_ns = max(point.at_ns - self._newest_ns, 1)
        rate = beyond_ns / since_ns + self._max_drift(point.at_ns)
        if rate <= 2 * STEERED_PPM * 1e-6:
            self._steered = max(self._steered, 2 * rate)
            self._steered_until_ns = point.at_ns + _STEERED_NS
        self.steps += 1
        self._forget()

    def _keep(self, point: _Point) -> None:
        part = point.at_ns // self._part_ns
        self._prove_rates(point)
        best = self._best.get(part)
        if best is None or point.width_ns <= best.width_ns:
            self._best[part] = point
        for old in [p for p in self._best if p <= part - self._parts]:
            self._retire(old, self._best.pop(old))
        # all age alike, so the best of now stays the best until the next exchange
        now_ns, rates = point.at_ns, self._rates
        points = self._points(point)
        self._lower = max(points, key=lambda p: p.lower_ns + rates.lowest * (now_ns - p.at_ns))
        self._upper = min(points, key=lambda p: p.upper_ns + rates.highest * (now_ns - p.at_ns))

    def _points(self, newest: _Point) -> list[_Point]:
        anchors = [anchor for anchor in (self._lower, self._upper) if anchor is not None]
        return [newest, *anchors, *self._best.values(), *self._older]

    def _retire(self, part: int, point: _Point) -> None:
        """Of each window that has passed keep the exchange that says most."""
        window = part // self._parts
        if self._older and self._older[-1].at_ns // (self._part_ns * self._parts) == window:
            if point.width_ns > self._older[-1].width_ns:
                return
            self._older.pop()
        self._older.append(point)

    def _prove_rates(self, point: _Point) -> None:
        """From any two exchanges: the mean rate between them lies within what their limits leave."""
        now_ns = point.at_ns
        most, wander = self._max_drift(now_ns), self._wander(now_ns)
        between = _mean_rates((p for p in self._points(point) if p.at_ns < now_ns), point)
        window = now_ns // (self._part_ns * self._parts)
        if self._proved and self._proved[-1][0] == window:
            between &= self._proved.pop()[1]
        self._proved.append((window, between))
        rates = _Rates(-most, most)
        for _, proved in self._proved:
            rates &= _Rates(proved.lowest - wander, proved.highest + wander)
        if rates.lowest > rates.highest:  # it wandered by more than the law: what was proved is void
            self._proved.clear()
            rates = _Rates(-most, most)
        self._rates = rates


def _mean_rates(before: Iterable[_Point], point: _Point) -> _Rates:
    """(θ' − θ) / (t' − t) for every θ and θ' within the limits of two exchanges."""
    rates = _Rates(-1.0, 1.0)
    for old in before:
        apart_ns = point.at_ns - old.at_ns
        rates &= _Rates(
            (point.lower_ns - old.upper_ns) / apart_ns, (point.upper_ns - old.lower_ns) / apart_ns
        )
    return rates
