"""The bound is true for clocks that are steered, and for lines whose delay changes for good."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import pytest

from common.clock import NS_PER_S
from common.clock_sync import ANY_CLOCKS, RAW_CLOCKS, OffsetEstimator, RateLaw

MS = 1_000_000
BETWEEN_NS = NS_PER_S // 4
"""As often as the master asks."""


@dataclass
class World:
    """A remote clock whose rate changes at given instants, on a line with a delay each way."""

    out_ns: int = 20 * MS
    back_ns: int = 20 * MS
    jitter_ns: int = 0
    now_ns: int = 0
    ahead_ns: float = 5e12
    ppm: float = 0.0
    chance: random.Random = field(default_factory=lambda: random.Random(7))

    def pass_ns(self, ns: int) -> None:
        self.ahead_ns += ns * self.ppm * 1e-6
        self.now_ns += ns

    @property
    def remote_ns(self) -> int:
        return round(self.now_ns + self.ahead_ns)

    def exchange(self, estimator: OffsetEstimator) -> None:
        sent_ns = self.now_ns
        self.pass_ns(self.out_ns + self.chance.randint(0, self.jitter_ns))
        received_ns = self.remote_ns
        self.pass_ns(20_000)
        replied_ns = self.remote_ns
        self.pass_ns(self.back_ns + self.chance.randint(0, self.jitter_ns))
        assert estimator.add(sent_ns, received_ns, replied_ns, self.now_ns)

    def error_ns(self, estimator: OffsetEstimator) -> tuple[float, int]:
        """How wrong the offset is now, and what bound it claims."""
        offset = estimator.estimate(self.now_ns)
        return abs(offset.offset_ns - self.ahead_ns), offset.bound_ns

    def untrue(self, estimator: OffsetEstimator, looks: int = 8) -> int:
        """Look several times until the next exchange: how often was the truth outside of the bound?"""
        outside = 0
        for _ in range(looks):
            self.pass_ns(BETWEEN_NS // looks)
            error_ns, bound_ns = self.error_ns(estimator)
            outside += error_ns > bound_ns + 1
        return outside


@pytest.mark.parametrize("most_ppm", [0, 100, 2_000, 10_000, 83_333, 100_000])
def test_however_clocks_are_steered_the_truth_is_within_the_bound(most_ppm: float) -> None:
    """Rates that change at any moment, delays that step on one way or both; 48,000 looks for each."""
    chance = random.Random(most_ppm)
    outside = 0
    for story in range(20):
        world = World(out_ns=chance.randint(50_000, 40 * MS), jitter_ns=2 * MS, chance=random.Random(story))
        estimator = OffsetEstimator(ANY_CLOCKS)
        for _ in range(300):
            if chance.random() < 0.1:
                world.ppm = chance.uniform(-most_ppm, most_ppm)
            if chance.random() < 0.02:
                world.out_ns = chance.randint(50_000, 400 * MS)
            if chance.random() < 0.02:
                world.back_ns = chance.randint(50_000, 400 * MS)
            world.exchange(estimator)
            outside += world.untrue(estimator)
    assert outside == 0
    assert estimator.steps == 0


def test_a_steered_clock_is_found_out_where_it_was_taken_for_a_raw_one() -> None:
    """The law allows 500 ppm. After a second at 2 % the truth is within the bound again, and stays there."""
    world, estimator = World(out_ns=200_000, back_ns=200_000), OffsetEstimator(RAW_CLOCKS)
    for _ in range(100):
        world.exchange(estimator)
        assert world.untrue(estimator) == 0
    assert world.error_ns(estimator)[1] < 0.3 * MS
    world.ppm = 20_000
    for _ in range(4):
        world.exchange(estimator)
        world.untrue(estimator)
    for n in range(200):
        world.ppm = 20_000 if n % 20 < 10 else -20_000
        world.exchange(estimator)
        assert world.untrue(estimator) == 0
    assert estimator.steps >= 1


def test_a_line_that_becomes_slow_keeps_the_offset_known() -> None:
    """Seen: 20 ms became 190 ms, and a minute later the best exchange was forgotten."""
    world, estimator = World(jitter_ns=MS), OffsetEstimator(RAW_CLOCKS)
    world.ppm = 12.0
    for _ in range(4 * 600):
        world.exchange(estimator)
        world.pass_ns(BETWEEN_NS)
    before_ns = world.error_ns(estimator)[1]
    assert before_ns < 22 * MS
    world.out_ns = world.back_ns = 190 * MS
    for minute in range(1, 11):
        for _ in range(100):
            world.exchange(estimator)
            world.pass_ns(BETWEEN_NS)
        error_ns, bound_ns = world.error_ns(estimator)
        assert error_ns <= bound_ns
        # ten minutes prove the rate to 40 ms / 600 s = 67 ppm, which with the wander is 5 ms a minute
        assert bound_ns < before_ns + minute * 6 * MS, f"after {minute} min"
        assert estimator.estimate(world.now_ns).trusted


def test_a_way_that_becomes_slow_loosens_its_own_limit_alone() -> None:
    world, estimator = World(out_ns=20 * MS, back_ns=20 * MS), OffsetEstimator(RateLaw(500.0, 500.0))
    for _ in range(100):
        world.exchange(estimator)
        world.pass_ns(BETWEEN_NS)
    world.out_ns = 190 * MS
    for _ in range(400):
        world.exchange(estimator)
        world.pass_ns(BETWEEN_NS)
    offset = estimator.estimate(world.now_ns)
    lower_ns = offset.offset_ns - offset.bound_ns
    assert world.ahead_ns - lower_ns < 21 * MS, "the way back is as it was"
    assert abs(offset.offset_ns - world.ahead_ns) <= offset.bound_ns


def test_the_allowance_for_a_steered_clock_ends() -> None:
    world, estimator = World(out_ns=200_000, back_ns=200_000), OffsetEstimator(RAW_CLOCKS)
    for ppm, exchanges in ((0.0, 20), (50_000.0, 20), (0.0, 4 * 700)):
        world.ppm = ppm
        for _ in range(exchanges):
            world.exchange(estimator)
            world.pass_ns(BETWEEN_NS)
    world.exchange(estimator)
    world.pass_ns(BETWEEN_NS)
    assert world.error_ns(estimator)[1] < 0.4 * MS
