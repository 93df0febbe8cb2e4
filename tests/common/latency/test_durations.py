"""Durations: exact mean and maximum, percentiles to three digits."""

import math

from hypothesis import given
from hypothesis import strategies as st

from common.clock import NS_PER_MS
from common.latency.durations import MOST_RECENT, Durations, StreamedDurations


@given(st.lists(st.integers(0, 100_000 * NS_PER_MS), min_size=1, max_size=50))
def test_percentiles_are_good_to_three_digits(durations: list[int]) -> None:
    recorded = Durations()
    for duration in durations:
        recorded.record(duration)
    summary = recorded.summary()
    median = min(sorted(durations)[(len(durations) + 1) // 2 - 1] / NS_PER_MS, 60_000)
    assert math.isclose(summary.p50 or 0.0, median, rel_tol=2e-3, abs_tol=1e-3)
    assert summary.max == max(durations) / NS_PER_MS
    assert math.isclose(summary.mean or 0.0, sum(durations) / len(durations) / NS_PER_MS, rel_tol=1e-12)


def test_a_duration_below_zero_is_counted_and_taken_as_zero() -> None:
    durations = Durations()
    durations.record(-5)
    assert durations.clamped == 1
    assert durations.summary().max == 0


def test_durations_are_published_one_by_one_and_once_each() -> None:
    streamed = StreamedDurations()
    for duration_ns in (1_500_000, -7, 999):
        streamed.record(duration_ns)
    assert streamed.take_recent() == (1500, 0, 1)
    assert streamed.take_recent() == ()
    assert (streamed.count, streamed.clamped) == (3, 1), "and stay in the whole"


def test_of_many_the_newest_are_published() -> None:
    streamed = StreamedDurations()
    for n in range(MOST_RECENT + 3):
        streamed.record(1000 * n)
    assert streamed.take_recent() == tuple(range(3, MOST_RECENT + 3))
