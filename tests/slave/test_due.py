"""What was due and did not come is counted, and is in the corrected figures, whichever side stalled."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.clock import NS_PER_MS as MS
from common.latency.durations import MOST_STEPS, Durations
from slave.due import DueCommands

PERIOD_NS = 80 * MS
ONE_WAY_NS = MS // 2


def followed(*put_ns: int, sequences: list[int] | None = None, clock: int = 1) -> DueCommands:
    due = DueCommands()
    numbers = sequences or list(range(1, len(put_ns) + 1))
    for sequence, at_ns in zip(numbers, put_ns, strict=True):
        due.note(clock, sequence, at_ns, ONE_WAY_NS)
    return due


def grid(*ticks: int, period_ns: int = PERIOD_NS) -> list[int]:
    return [tick * period_ns for tick in ticks]


def test_an_unbroken_row_misses_nothing_and_its_figures_are_raw() -> None:
    due = followed(*grid(*range(1, 200)))
    assert (due.metrics().expected, due.metrics().missing) == (199, 0)
    assert due.corrected.summary().max == 0.5


def test_a_common_still_of_5_s_misses_62_commands() -> None:
    ticks = [*range(1, 101), *range(163, 263)]
    due = followed(*grid(*ticks))
    assert due.metrics().missing == 62
    corrected = due.corrected.summary()
    assert corrected.count == 262
    # the first that was due waited for all the time but one period
    assert corrected.max == pytest.approx(62 * 80 + 0.5)
    assert corrected.p99 is not None
    assert corrected.p99 > 4500.0
    assert len(due.recent.take_recent()) == 62


def test_lost_numbers_are_missing_by_time_too() -> None:
    numbers = [n for n in range(1, 101) if n not in (50, 51)]
    due = followed(*grid(*numbers), sequences=numbers)
    assert due.metrics().missing == 2
    assert due.corrected.summary().max == pytest.approx(160.5)


@pytest.mark.parametrize(("late_ms", "missing"), [(59, 0), (60, 1)])
def test_a_late_turn_of_the_master_is_no_missing_command(late_ms: int, missing: int) -> None:
    put_ns = grid(*range(1, 100))
    put_ns[-1] += late_ms * MS
    assert followed(*put_ns).metrics().missing == missing


@pytest.mark.parametrize("period_ns", [40 * MS, 80 * MS, 200 * MS])
def test_a_master_of_another_rate_is_held_to_its_own(period_ns: int) -> None:
    due = followed(*grid(*range(1, 101), period_ns=period_ns))
    before = due.metrics().missing
    due.note(1, 101, 111 * period_ns, ONE_WAY_NS)
    assert due.metrics().missing - before == 10


def test_another_master_s_clock_begins_anew_a_new_lease_does_not() -> None:
    due = followed(*grid(1, 2, 3))
    due.note(2, 1, 10**15, ONE_WAY_NS)
    assert due.metrics().missing == 0
    due.note(2, 2, 10**15 + 11 * PERIOD_NS, ONE_WAY_NS)
    assert due.metrics().missing == 10


def test_nothing_is_due_of_a_robot_that_was_given_back() -> None:
    due = followed(*grid(1, 2, 3))
    due.forget()
    due.note(1, 4, 1000 * PERIOD_NS, ONE_WAY_NS)
    assert due.metrics().missing == 0


def test_a_gap_counts_although_the_offset_lost_trust_after_it() -> None:
    due = followed(*grid(1, 2, 3))
    due.note(1, 4, 14 * PERIOD_NS, None)
    assert due.metrics().missing == 10
    assert due.corrected.count == 13


@given(st.lists(st.integers(1, 400), min_size=2, max_size=60, unique=True).map(sorted))
def test_expected_is_every_tick_between_the_first_and_the_last(ticks: list[int]) -> None:
    due = followed(*grid(*ticks), sequences=ticks)
    assert due.metrics().expected == ticks[-1] - ticks[0] + 1
    assert due.metrics().missing == sum(b - a - 1 for a, b in pairwise(ticks))


@given(st.integers(1, 5000), st.integers(0, 200))
def test_many_are_taken_in_few_steps_with_the_same_count_and_mean(count: int, rest_ms: int) -> None:
    longest_ns = count * PERIOD_NS + rest_ms * MS
    few, one_by_one = Durations(), Durations()
    few.record_missing(longest_ns, PERIOD_NS, count)
    for i in range(count):
        one_by_one.record(longest_ns - i * PERIOD_NS)
    a, b = few.summary(), one_by_one.summary()
    assert (a.count, a.max) == (b.count, b.max)
    assert a.mean == pytest.approx(b.mean, rel=1e-6, abs=1e-3)
    assert a.p50 == pytest.approx(b.p50, abs=80.0 * (count // MOST_STEPS + 2))


def test_the_correction_is_hdr_histogram_s_own() -> None:
    theirs = pytest.importorskip("hdrh.histogram").HdrHistogram(1, 60_000_000, 3)
    theirs.record_corrected_value(5_000_000, 80_000)
    ours = Durations()
    ours.record_missing(5_000_000_000, PERIOD_NS, 63)
    summary = ours.summary()
    assert summary.count == theirs.get_total_count()
    for percentile, value in ((50, summary.p50), (99, summary.p99)):
        assert value == theirs.get_value_at_percentile(percentile) / 1000
