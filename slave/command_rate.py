"""How many commands a second the robot asks for, by what its line has lately done to them. Pure.

12.5 a second is what every line must carry. A line that loses little and delays evenly is asked for 25, one
that is also as quick as a LAN for 50. Where loss or jitter comes, the robot asks for 12.5 at once: more
messages may be what fills the line. It tries again later, each time after twice as long.

Loss is counted by the commands' numbers, jitter by the spread of their time on the line. Neither needs the
clocks' offset: only a LAN's short delay is believed by it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from common.clock import NS_PER_MS, to_ms, to_ns, to_s
from common.clock_sync import Offset
from common.metrics.slave import RateMetrics
from common.wire.messages import Command

USUAL_MS = 80
"""Between two commands, where nothing is negotiated."""
WINDOW_NS = to_ns(6.0)
"""For how long an arrival is evidence for a higher rate."""
LATELY_NS = to_ns(2.0)
"""And for how long against the one in force."""
EVIDENCE_NS = to_ns(5.0)
"""A rate is raised on no less."""
BACK_NS = to_ns(1.0)
"""The own clock went back where a command comes so much before the last; less is two paths' two threads."""
LOOKS_NS = to_ns(0.2)
"""A decision costs what ten commands do."""
LEAST = 12
"""With fewer commands lately nothing is said against a rate."""
LOST_LATELY = 3
"""Commands: with fewer lost ones lately it was one burst, which any line has now and then."""
FIRST_WAIT_NS, MOST_WAIT_NS = to_ns(10.0), to_ns(160.0)
"""After a fall, until a higher rate is asked for again; twice as long after each fall."""
PROVEN_NS = to_ns(60.0)
"""A rate that was kept for so long was right: the next fall counts as the first."""


@dataclass(frozen=True, slots=True)
class Rate:
    """One rate, and the line that may be asked for it; `falls` are the values at which it is given up."""

    period_ms: int
    most_spread_ms: float
    falls_spread_ms: float
    most_lost: float
    falls_lost: float
    most_one_way_ms: float

    def bears(self, spread_ms: float, lost: float, one_way_ms: float) -> bool:
        """Whether a line that is like this may be asked for it."""
        return (
            spread_ms <= self.most_spread_ms and lost <= self.most_lost and one_way_ms <= self.most_one_way_ms
        )


RATES = (
    Rate(20, 5.0, 10.0, 0.002, 0.02, 10.0),
    Rate(40, 25.0, 35.0, 0.01, 0.04, float("inf")),
)
"""Fastest first. 4G as `deploy/sim/network/profiles/4g.toml` has it spreads by 20 ms, Wi-Fi by 8 ms."""


@dataclass(frozen=True, slots=True)
class _Passage:
    at_ns: int
    transit_ns: int
    """By both hosts' clocks as they are: only differences count."""
    lost_before: int


class WantedRate:
    """Follows the commands of one lease's holder after the other."""

    def __init__(self) -> None:
        self.falls = 0
        self.words = "nothing is known of the line yet"
        """Why this rate, for people."""
        self.period_ms = USUAL_MS
        """Between two commands, as the robot asks for it."""
        self.in_force_ms = 0
        """As the newest command says; 0: it says nothing."""
        self._wait_ns = FIRST_WAIT_NS
        self._not_before_ns: int | None = None
        self.begin()

    def begin(self) -> None:
        """Another lease: its numbers, and perhaps its line, are others. The rate begins at the usual one."""
        self._arrivals: deque[_Passage] = deque()
        self._sequence = -1
        self._since_ns: int | None = None
        self._looked_ns: int | None = None
        self.in_force_ms = 0
        self.period_ms = USUAL_MS

    def note(self, command: Command, received_ns: int, offset: Offset) -> None:
        """Take a command of the lease's holder, in the order of arrival."""
        lost = command.sequence - self._sequence - 1 if self._sequence >= 0 else 0
        if lost < 0:  # repeated or overtaken: it was counted as lost, which on such a line it is
            return
        if self._arrivals and received_ns < self._arrivals[-1].at_ns - BACK_NS:
            self.begin()  # the own clock went back
        self._sequence, self.in_force_ms = command.sequence, command.period_ms
        self._arrivals.append(_Passage(received_ns, received_ns - command.stamps.put_ns, lost))
        while received_ns - self._arrivals[0].at_ns > WINDOW_NS:
            self._arrivals.popleft()
        if self._since_ns is None:
            self._since_ns = received_ns
        if self._looked_ns is None or received_ns - self._looked_ns >= LOOKS_NS:
            self._looked_ns = received_ns
            self._decide(received_ns, offset)

    def _decide(self, now_ns: int, offset: Offset) -> None:
        lately = [one for one in self._arrivals if now_ns - one.at_ns <= LATELY_NS]
        in_use = next((rate for rate in RATES if rate.period_ms == self.period_ms), None)
        if in_use is not None:
            why = _against(in_use, lately)
            if why:
                self._fall(now_ns, why)
                return
            if self._since_ns is not None and now_ns - self._since_ns > PROVEN_NS:
                self._wait_ns = FIRST_WAIT_NS
        if self._arrivals[-1].at_ns - self._arrivals[0].at_ns < EVIDENCE_NS:
            return
        if self._not_before_ns is not None and now_ns < self._not_before_ns:
            return
        spread_ms, lost = _spread_ms(self._arrivals), _lost(self._arrivals)
        one_way_ms = self._one_way_ms(offset)
        for rate in RATES:
            if rate.period_ms >= self.period_ms:
                break
            if rate.bears(spread_ms, lost, one_way_ms):
                self._change(now_ns, rate.period_ms)
                break
        self.words = f"jitter {spread_ms:.0f} ms, {100.0 * lost:.1f} % lost"

    def _fall(self, now_ns: int, why: str) -> None:
        self.falls += 1
        self._not_before_ns = now_ns + self._wait_ns
        self.words = f"{why}; a higher rate is tried again in {to_s(self._wait_ns):.0f} s"
        self._wait_ns = min(2 * self._wait_ns, MOST_WAIT_NS)
        self._change(now_ns, USUAL_MS)
        self._arrivals.clear()

    def _change(self, now_ns: int, period_ms: int) -> None:
        self.period_ms, self._since_ns = period_ms, now_ns

    def _one_way_ms(self, offset: Offset) -> float:
        """The most that a usual command may have taken; infinite where the offset is not known."""
        if not offset.trusted:
            return float("inf")
        usual_ns = sorted(one.transit_ns for one in self._arrivals)[len(self._arrivals) // 2]
        return to_ms(usual_ns + offset.offset_ns + offset.bound_ns)

    def metrics(self) -> RateMetrics:
        """What is in force, what is asked for, and why."""
        return RateMetrics(
            hz=_hz(self.in_force_ms), wanted_hz=_hz(self.period_ms), falls=self.falls, words=self.words
        )


def _hz(period_ms: int) -> float | None:
    return 1e3 / period_ms if period_ms else None


def _against(rate: Rate, lately: list[_Passage]) -> str:
    """What speaks against a rate that is in force; empty where nothing does."""
    if len(lately) < LEAST:
        return ""
    lost = _lost(lately)
    if lost > rate.falls_lost and sum(one.lost_before for one in lately) >= LOST_LATELY:
        return f"{100.0 * lost:.0f} % of the commands were lost"
    spread_ms = _spread_ms(lately)
    return f"jitter of {spread_ms:.0f} ms" if spread_ms > rate.falls_spread_ms else ""


def _lost(arrivals: deque[_Passage] | list[_Passage]) -> float:
    lost = sum(one.lost_before for one in arrivals)
    return lost / (lost + len(arrivals))


def _spread_ms(arrivals: deque[_Passage] | list[_Passage]) -> float:
    """From the time on the line that 10 % of the commands kept to that which 90 % kept."""
    transits = sorted(one.transit_ns for one in arrivals)
    return (transits[int(0.9 * len(transits))] - transits[int(0.1 * len(transits))]) / NS_PER_MS
