"""How far another host's monotonic clock is ahead of ours, and within what bound. Pure.

From the four stamps of an exchange: ours t1 (sent) and t4 (heard), theirs t2 (received) and t3 (sent).
Whatever the delays of the two ways, none is negative, so at t4 the offset θ = theirs − ours obeys

    t3 − t4 − ρ(t4 − t1)  ≤  θ  ≤  t2 − t1 + ρ(t4 − t1)

where ρ is the most that two clocks drift apart. The middle is off by at most half the round trip
(NTP: RFC 5905, section 8), plus what drift adds. That is certain, not likely: no symmetry is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from common.clock import NS_PER_S, to_ns

UNKNOWN_NS = 1 << 62
"""The bound where nothing is known: 146 years."""
_ROUNDING_NS = 2


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


NEVER_MEASURED = Offset(0, UNKNOWN_NS, trusted=False)


@dataclass(frozen=True, slots=True)
class _Point:
    """What one exchange says: at `at_ns` (ours) the offset was `offset_ns` ± `error_ns`."""

    at_ns: int
    offset_ns: int
    error_ns: float
    round_trip_ns: int


class OffsetEstimator:
    """Keeps the shortest round trip of each part of a window, and the drift fitted through them.

    The reported offset is that of one exchange, the one whose bound is smallest by now: half its round
    trip plus `drift uncertainty × age`. Times are ns of the local monotonic clock.
    """

    def __init__(
        self,
        window_s: float = 60.0,
        parts: int = 30,
        stale_after_s: float = 5.0,
        trusted_from: int = 3,
        max_drift_ppm: float = 200.0,
        wander_ppm: float = 5.0,
    ) -> None:
        """`wander_ppm`: how far the drift itself may change within a window (temperature, NTP slewing)."""
        self._part_ns = to_ns(window_s / parts)
        self._parts = parts
        self._stale_after_ns = to_ns(stale_after_s)
        self._trusted_from = trusted_from
        self._max_drift = max_drift_ppm * 1e-6
        self._wander = wander_ppm * 1e-6
        self.refused = 0
        """Exchanges with stamps that cannot be, such as a round trip below zero."""
        self.steps = 0
        """Times the remote clock jumped by more than the bounds allow, and all was forgotten."""
        self._forget()

    def _forget(self) -> None:
        self._best: dict[int, _Point] = {}
        self._anchor: _Point | None = None
        self._drift = 0.0
        self._drift_error = self._max_drift
        self._exchanges = 0
        self._newest_ns = 0

    def add(
        self, local_sent_ns: int, remote_received_ns: int, remote_sent_ns: int, local_received_ns: int
    ) -> bool:
        """Take the four stamps t1, t2, t3, t4 of an exchange; False if they are impossible."""
        away_ns = local_received_ns - local_sent_ns
        held_ns = remote_sent_ns - remote_received_ns
        round_trip_ns = away_ns - held_ns
        error_ns = round_trip_ns / 2 + self._max_drift * away_ns + _ROUNDING_NS
        if away_ns < 0 or held_ns < 0 or error_ns < 0 or local_received_ns < self._newest_ns:
            self.refused += 1
            return False
        offset_ns = (remote_received_ns - local_sent_ns + remote_sent_ns - local_received_ns) // 2
        point = _Point(local_received_ns, offset_ns, error_ns, max(round_trip_ns, 0))
        if self._contradicts(point):
            self.steps += 1
            self._forget()
        self._exchanges += 1
        self._newest_ns = local_received_ns
        self._keep(point)
        return True

    def estimate(self, now_ns: int) -> Offset:
        """The offset now, its bound, and whether it may be relied on."""
        anchor = self._anchor
        if anchor is None:
            return NEVER_MEASURED
        age_ns = now_ns - anchor.at_ns
        bound_ns = anchor.error_ns + self._drift_error * abs(age_ns) + _ROUNDING_NS
        fresh = now_ns - self._newest_ns <= self._stale_after_ns
        return Offset(
            anchor.offset_ns + round(self._drift * age_ns),
            round(bound_ns),
            trusted=fresh and self._exchanges >= self._trusted_from,
        )

    @property
    def drift_ppm(self) -> float:
        """How much faster the remote clock runs than ours; 0 while that is not known well enough."""
        return self._drift * 1e6

    @property
    def round_trip_ns(self) -> int | None:
        """The shortest round trip of the window."""
        return min((p.round_trip_ns for p in self._best.values()), default=None)

    def _contradicts(self, point: _Point) -> bool:
        if self._anchor is None:
            return False
        expected = self.estimate(point.at_ns)
        return abs(point.offset_ns - expected.offset_ns) > expected.bound_ns + point.error_ns

    def _keep(self, point: _Point) -> None:
        part = point.at_ns // self._part_ns
        best = self._best.get(part)
        if best is None or point.error_ns <= best.error_ns:
            self._best[part] = point
        for old in [p for p in self._best if p <= part - self._parts]:
            del self._best[old]
        points = list(self._best.values())
        if points[-1] is not point:
            points.append(point)
        self._drift, self._drift_error = _fit_drift(points, self._max_drift, self._wander)
        # all age alike, so the best of now stays the best until the next exchange
        self._anchor = min(points, key=lambda p: p.error_ns + self._drift_error * (point.at_ns - p.at_ns))


def _fit_drift(points: Sequence[_Point], max_drift: float, wander: float) -> tuple[float, float]:
    """Least-squares slope through the points, and the most it can be wrong: (drift, error), ns per ns.

    With weights w the slope is Σ wᵢθᵢ, so errors of at most eᵢ shift it by at most Σ |wᵢ|eᵢ. Where that
    says no more than the limit of any clock, the drift is taken as 0 ± max_drift.
    """
    last = points[-1]
    times = [p.at_ns - last.at_ns for p in points]
    mean = sum(times) / len(times)
    spread = sum((t - mean) ** 2 for t in times)
    if spread < NS_PER_S**2:
        return 0.0, max_drift
    weights = [(t - mean) / spread for t in times]
    slope = sum(w * (p.offset_ns - last.offset_ns) for w, p in zip(weights, points, strict=True))
    error = sum(abs(w) * p.error_ns for w, p in zip(weights, points, strict=True)) + wander
    if error >= max_drift:
        return 0.0, max_drift
    return max(-max_drift, min(max_drift, slope)), error
