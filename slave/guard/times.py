"""How old a command may be and how long none may come, as the link needs, within the site's ceilings. Pure.

A long line makes every command old; a rough one makes gaps. Both times start at what the file says
(`max_age_s`, `command_timeout_s`), and grow on evidence only:

- the age that commands need: what 85 % of the last seconds' ones kept, the offset's bound, and their spread;
- the time-out: the third largest gap between arrivals of the last seconds, and the gaps' spread.

So one outage, or two, prove nothing, and neither do the commands that it held back; and a gap that no allowed
time-out would bridge is never evidence. Gaps are from arrival to arrival on the own clock; the sender's
stamps count only through the offset with its bound.
What is in force follows slowly upwards, slower still while the robot follows; quickly back; never above the
ceiling, however slowly somebody stretches a line.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

from common.clock import NS_PER_MS, to_ns, to_s
from common.clock_sync import Offset
from common.metrics.slave import GuardTimes
from common.wire.messages import Command
from slave.guard.config import GuardConfig

WINDOW_NS = to_ns(20.0)
"""For how long an arrival is evidence."""
USUAL = 0.85
"""Share of the commands that tells the usual age: the others may be an outage's."""
LEAST = 12
"""With fewer commands, or all within `SPAN_NS`, nothing is known: what a burst brings is one event."""
SPAN_NS = to_ns(1.0)
REPEATED = 3
"""A gap is the line's own if as large a one came so often."""
SPREADS = 4.0
"""Deviations added, as TCP's retransmission timer does (RFC 6298)."""
_SIGMA_OF_MAD = 1.4826
"""Rousseeuw and Croux 1993."""
AGE_MARGIN_NS, GAP_MARGIN_NS = 40 * NS_PER_MS, 20 * NS_PER_MS
"""At least, so that a line that becomes a little slower is followed without a hold."""
GROWS, GROWS_STANDING, SHRINKS = 0.02, 0.1, 0.05
"""s per s: while the robot follows; while it stands and nothing is at risk; back."""
_STEP_NS = to_ns(0.2)
"""The longest time between two arrivals that counts for this: silence proves nothing."""


@dataclass(frozen=True, slots=True)
class _Arrival:
    at_ns: int
    """Own clock."""
    age_ns: int
    """When it arrived, through the offset."""
    transit_ns: int
    """Of which on the link."""
    gap_ns: int
    """Since the arrival before, 0 for the first of a lease."""


class LinkTimes:
    """`max_age_ns` and `command_timeout_ns` in force, and what the line would need."""

    def __init__(self, config: GuardConfig) -> None:
        self._least_ns = to_ns(config.max_age_s), to_ns(config.command_timeout_s)
        self.ceilings_ns = to_ns(config.age_ceiling_s), to_ns(config.timeout_ceiling_s)
        """Of the age and of the time-out."""
        self.max_age_ns, self.command_timeout_ns = self._least_ns
        self.forget()

    def forget(self) -> None:
        """Another operator's line: nothing is known of it."""
        self.max_age_ns, self.command_timeout_ns = self._least_ns
        self._arrivals: deque[_Arrival] = deque()
        self._bound_ns = 0
        self._needs_ns: tuple[int | None, int | None] = (None, None)
        self.begin()

    def begin(self) -> None:
        """A new lease: numbers count anew, and the time until its first command is no gap."""
        self._last_ns: int | None = None
        self._sequence = -1

    def note(self, command: Command, received_ns: int, offset: Offset, *, moving: bool) -> None:
        """Take a command that is genuine and newer than all before, whether or not it is too old.

        `moving`: whether the robot follows.
        """
        if command.sequence <= self._sequence:
            return
        if self._arrivals and received_ns < self._arrivals[-1].at_ns:
            self.forget()  # the own clock went back
        last_ns, self._last_ns, self._sequence = self._last_ns, received_ns, command.sequence
        stamps = command.stamps
        self._arrivals.append(
            _Arrival(
                received_ns,
                received_ns - offset.local_ns(stamps.sampled_ns),
                received_ns - offset.local_ns(stamps.put_ns),
                0 if last_ns is None else received_ns - last_ns,
            )
        )
        while received_ns - self._arrivals[0].at_ns > WINDOW_NS:
            self._arrivals.popleft()
        self._bound_ns = offset.bound_ns
        self._needs_ns = self._age_needed_ns(), self._timeout_needed_ns()
        step_ns = 0 if last_ns is None else min(received_ns - last_ns, _STEP_NS)
        self._follow(step_ns, GROWS if moving else GROWS_STANDING)

    def _follow(self, step_ns: int, grows: float) -> None:
        if len(self._arrivals) == 1:  # after a long silence
            self.max_age_ns, self.command_timeout_ns = self._least_ns
            return
        up_ns, down_ns = round(grows * step_ns), round(SHRINKS * step_ns)
        age_ns, gap_ns = self._needs_ns[0], self._usual_gap_ns(self.ceilings_ns[1])
        for_gap_ns = None if gap_ns is None else gap_ns + self._gap_spread_ns()
        self.max_age_ns, self.command_timeout_ns = (
            min(max(min(max(need_ns or 0, least_ns), ceiling_ns), now_ns - down_ns), now_ns + up_ns)
            for now_ns, need_ns, least_ns, ceiling_ns in zip(
                (self.max_age_ns, self.command_timeout_ns), (age_ns, for_gap_ns),
                self._least_ns, self.ceilings_ns, strict=True,
            )
        )  # fmt: skip

    def _ages_ns(self) -> tuple[int, int] | None:
        """The median age, and how much older the usual oldest is; None where too little is known."""
        arrivals = self._arrivals
        if len(arrivals) < LEAST or arrivals[-1].at_ns - arrivals[0].at_ns < SPAN_NS:
            return None
        ages_ns = sorted(one.age_ns for one in arrivals)
        middle_ns = round(median(ages_ns))
        return middle_ns, ages_ns[int(USUAL * len(ages_ns))] - middle_ns

    def _age_needed_ns(self) -> int | None:
        ages_ns = self._ages_ns()
        if ages_ns is None:
            return None
        middle_ns, spread_ns = ages_ns
        margin_ns = max(round(SPREADS * spread_ns), AGE_MARGIN_NS)
        return middle_ns + spread_ns + self._bound_ns + margin_ns

    def _gaps_ns(self) -> list[int]:
        return [one.gap_ns for one in self._arrivals if one.gap_ns]

    def _usual_gap_ns(self, at_most_ns: int | None = None) -> int | None:
        """The largest gap that came `REPEATED` times; of those at most so large, where that is asked."""
        gaps_ns = sorted(gap for gap in self._gaps_ns() if at_most_ns is None or gap <= at_most_ns)
        return gaps_ns[-REPEATED] if len(gaps_ns) >= LEAST else None

    def _gap_spread_ns(self) -> int:
        return max(round(SPREADS * _sigma(self._gaps_ns())), GAP_MARGIN_NS)

    def _timeout_needed_ns(self) -> int | None:
        gap_ns = self._usual_gap_ns()
        return None if gap_ns is None else gap_ns + self._gap_spread_ns()

    @property
    def beyond(self) -> str:
        """Which ceiling the line exceeds, in words; empty where none."""
        words = [
            f"the line needs {key} {to_s(need_ns):.2f} s, the site's ceiling ({key[:-2]}_ceiling_s) is "
            f"{to_s(ceiling_ns):.2f} s"
            for key, need_ns, ceiling_ns in zip(
                ("max_age_s", "command_timeout_s"), self._needs_ns, self.ceilings_ns, strict=True
            )
            if need_ns is not None and need_ns > ceiling_ns
        ]
        return "; ".join(words)

    def metrics(self) -> GuardTimes:
        """What is in force, and why."""
        age_s, timeout_s = to_s(self.max_age_ns), to_s(self.command_timeout_ns)
        known, ages_ns = "nothing is known of the line yet", self._ages_ns()
        one_way_s = bound_s = jitter_s = None
        if ages_ns is not None:
            one_way_s = to_s(round(median(one.transit_ns for one in self._arrivals)))
            bound_s, jitter_s = to_s(self._bound_ns), to_s(ages_ns[1])
            known = f"one way {one_way_s:.2f} s ± {bound_s:.2f}, jitter {jitter_s:.3f}"
        words = f"commands may be {age_s:.2f} s old ({known}), and none may come for {timeout_s:.2f} s"
        needs_s = [None if need_ns is None else round(to_s(need_ns), 4) for need_ns in self._needs_ns]
        return GuardTimes(
            max_age_s=age_s, command_timeout_s=timeout_s,
            max_age_ceiling_s=to_s(self.ceilings_ns[0]), command_timeout_ceiling_s=to_s(self.ceilings_ns[1]),
            needs_age_s=needs_s[0], needs_timeout_s=needs_s[1],
            one_way_s=one_way_s, bound_s=bound_s, jitter_s=jitter_s,
            words=words, beyond=self.beyond,
        )  # fmt: skip


def _sigma(values_ns: list[int]) -> float:
    """The standard deviation, ns, by the median absolute deviation."""
    if not values_ns:
        return 0.0
    middle = median(values_ns)
    return _SIGMA_OF_MAD * median(abs(value - middle) for value in values_ns)
