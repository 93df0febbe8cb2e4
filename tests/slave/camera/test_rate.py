"""The rate control on a virtual link: a queue that empties at some rate, and 12.5 commands a second."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slave.camera.rate import LEAST_BYTES, RateControl, RateLimits

MS = 1_000_000
S = 1000 * MS
LIMITS = RateLimits(most_rate_hz=12.0, least_rate_hz=1.0, most_delay_ns=30 * MS, most_bytes=40_000)


@dataclass
class World:
    """Pictures fill their budget; the operator's commands tell of the newest that has arrived."""

    bytes_per_s: float
    rate: RateControl = field(default_factory=lambda: RateControl(LIMITS))
    now_ns: int = 0
    free_ns: int = 0
    number: int = 0
    hears: bool = True
    fills: float = 1.0
    travelling: deque[tuple[int, int, int]] = field(default_factory=deque)
    waits_ns: list[int] = field(default_factory=list)
    sent_ns: list[int] = field(default_factory=list)
    most_under_way: int = 0

    def run(self, seconds: float) -> None:
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            self.now_ns += MS
            due_ns = self.rate.due_ns(self.now_ns)
            if due_ns is not None and due_ns <= self.now_ns:
                self._send()
            self.most_under_way = max(self.most_under_way, len(self.rate._under_way))
            if self.now_ns % (80 * MS) == 0 and self.hears:
                self._acknowledge()

    def _send(self) -> None:
        self.number += 1
        size = round(self.fills * self.rate.budget_bytes)
        self.free_ns = max(self.free_ns, self.now_ns) + round(size / self.bytes_per_s * S)
        self.travelling.append((self.number, self.now_ns, self.free_ns))
        self.rate.sent(self.number, size, self.now_ns)
        self.waits_ns.append(self.free_ns - self.now_ns)
        self.sent_ns.append(self.now_ns)

    def _acknowledge(self) -> None:
        seen = None
        while self.travelling and self.travelling[0][2] <= self.now_ns:
            seen = self.travelling.popleft()
        if seen is not None:
            self.rate.seen(seen[0], self.now_ns, seen[2] - seen[1])


@pytest.mark.parametrize("kb_s", [100, 300, 1000])
def test_what_is_sent_beside_a_picture_waits_hardly_longer_than_asked(kb_s: float) -> None:
    world = World(1000 * kb_s)
    world.run(20)
    late = sorted(world.waits_ns)[int(0.99 * len(world.waits_ns))]
    assert late < 1.5 * LIMITS.most_delay_ns
    # and the link is used: half of what would be allowed
    settled = world.waits_ns[len(world.waits_ns) // 2 :]
    assert sum(settled) / len(settled) > 0.5 * min(LIMITS.most_delay_ns, S * 40 / kb_s)


def test_a_good_link_gets_the_best_within_seconds() -> None:
    world = World(12_500_000.0)
    world.run(8)
    assert world.rate.budget_bytes == LIMITS.most_bytes
    assert world.rate.lowered == 0
    assert len([t for t in world.sent_ns if t > world.now_ns - S]) == pytest.approx(12, abs=1)


def test_the_bitrate_falls_within_a_second_on_a_worse_link_and_returns() -> None:
    world = World(12_500_000.0)
    world.run(8)
    world.bytes_per_s = 100_000.0
    world.run(3)
    world.waits_ns.clear()
    world.run(3)
    assert max(world.waits_ns) < 2 * LIMITS.most_delay_ns
    world.bytes_per_s = 12_500_000.0
    world.run(8)
    assert world.rate.budget_bytes == LIMITS.most_bytes


def test_while_nobody_sees_anything_it_sends_little_but_never_stops() -> None:
    world = World(1_000_000.0, hears=False)
    world.run(10)
    world.sent_ns.clear()
    world.run(20)
    assert 10 <= len(world.sent_ns) <= 2 * 20 + 2
    assert world.rate.budget_bytes == LEAST_BYTES
    world.hears = True
    world.run(15)
    assert world.rate.budget_bytes > 5_000


def test_pictures_that_need_little_earn_no_larger_budget() -> None:
    world = World(12_500_000.0, fills=0.5)
    world.run(10)
    assert world.rate.budget_bytes == LEAST_BYTES


def test_without_a_trusted_clock_nothing_is_learnt_but_that_it_arrived() -> None:
    rate = RateControl(LIMITS)
    rate.sent(1, LEAST_BYTES, 0)
    rate.seen(1, 50 * MS, None)
    assert not rate._under_way
    assert rate.budget_bytes == LEAST_BYTES


def test_one_congestion_lowers_once_though_two_pictures_tell_of_it() -> None:
    rate = RateControl(LIMITS)
    for number in range(1, 20):
        rate.sent(number, rate.budget_bytes, number * 100 * MS)
        rate.seen(number, number * 100 * MS + MS, MS)
    before = rate.budget_bytes
    rate.sent(20, before, 2000 * MS)
    rate.sent(21, before, 2080 * MS)
    rate.seen(20, 2200 * MS, 100 * MS)
    rate.seen(21, 2280 * MS, 100 * MS)
    assert rate.lowered == 1
    assert rate.budget_bytes == pytest.approx(0.6 * before, abs=1)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(kb_s=st.lists(st.floats(2.0, 20_000.0), min_size=1, max_size=4), hears=st.booleans())
def test_whatever_the_link_does_the_bounds_hold(kb_s: list[float], hears: bool) -> None:
    world = World(1.0, hears=hears)
    for one in kb_s:
        world.bytes_per_s = 1000 * one
        world.run(2)
        assert LEAST_BYTES <= world.rate.budget_bytes <= LIMITS.most_bytes
    assert world.most_under_way <= 2
    gaps = [b - a for a, b in zip(world.sent_ns, world.sent_ns[1:], strict=False)]
    assert min(gaps, default=S) >= 83 * MS
    assert max(gaps, default=0) <= 3 * S


def told_lost(after_s: float, acknowledged: int | None = None) -> RateControl:
    """Four pictures reached the operator 80 ms after they were sent; then somebody says that one was lost."""
    rate, ms = RateControl(LIMITS), 1_000_000
    for number in range(1, 5):
        rate.sent(number, 1500, number * 200 * ms)
        rate.seen(number, (number * 200 + 80) * ms, 5 * ms)
    rate.sent(5, 1500, 1000 * ms)
    rate.sent(6, 1500, 1010 * ms)
    assert rate.due_ns(1020 * ms) is None, "two are under way"
    rate.lost_on_way(1020 * ms)
    assert rate.due_ns(1020 * ms) is not None, "the next may be sent at once"
    if acknowledged is not None:
        rate.seen(acknowledged, 1090 * ms, 5 * ms)
    rate.due_ns(1020 * ms + round(1e9 * after_s))
    return rate


def test_a_viewer_s_loss_does_not_lower_the_operator_s_rate() -> None:
    for acknowledged in (5, 6):
        rate = told_lost(1.0, acknowledged)
        assert (rate.lowered, rate.lost) == (0, 0), "the operator has them"


def test_a_loss_of_the_operator_s_lowers_it_once_the_acknowledgement_is_overdue() -> None:
    assert told_lost(0.119).lowered == 0
    assert (told_lost(0.13).lowered, told_lost(0.13).lost) == (1, 2)
    assert told_lost(5.0).lowered == 1


def test_before_any_acknowledgement_a_loss_counts_after_a_third_of_a_second() -> None:
    rate = RateControl(LIMITS)
    rate.sent(1, 1500, 0)
    rate.lost_on_way(10_000_000)
    rate.due_ns(300_000_000)
    assert rate.lowered == 0
    rate.due_ns(320_000_000)
    assert rate.lowered == 1
