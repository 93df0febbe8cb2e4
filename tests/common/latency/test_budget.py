"""The latency budget: the rows are the stages, and their means add up to the whole."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.clock import NS_PER_MS
from common.clock_sync import Offset
from common.latency.budget import LatencyBudget, StageTimes
from common.latency.stamps import STAGES, Passage
from common.metrics.parts import Summary

stamps = st.lists(st.integers(0, 100 * NS_PER_MS), min_size=8, max_size=8)


def there(value: float | None) -> float:
    assert value is not None
    return value


def passage(steps_ns: list[int], master_ahead_ns: int = 0) -> Passage:
    times = [sum(steps_ns[: i + 1]) for i in range(8)]
    return Passage(*times[:4], *(t - master_ahead_ns for t in times[4:]))


@given(
    st.lists(stamps, min_size=1, max_size=30),
    st.integers(-(10**15), 10**15),
    st.integers(-NS_PER_MS, NS_PER_MS),
)
def test_the_rows_add_up_to_the_whole(all_steps: list[list[int]], ahead_ns: int, error_ns: int) -> None:
    budget = LatencyBudget()
    for steps in all_steps:
        budget.record(passage(steps, ahead_ns), Offset(ahead_ns + error_ns, NS_PER_MS, trusted=True))
    rows, total = budget.summary(), budget.total()
    assert list(rows) == list(STAGES)
    assert {row.count for row in rows.values()} == {total.count} == {len(all_steps)}
    means = [there(row.mean) for row in rows.values()]
    assert math.isclose(sum(means), there(total.mean), rel_tol=1e-12, abs_tol=1e-12)


def test_each_stage_is_the_time_between_its_stamps() -> None:
    budget = LatencyBudget()
    steps = [0, *(n * NS_PER_MS for n in range(1, 8))]
    budget.record(passage(steps, master_ahead_ns=12345), Offset(12345, 70_000, trusted=True))
    rows = budget.summary()
    assert [row.max for row in rows.values()] == [1, 2, 3, 4, 5, 6, 7]
    assert [round(there(row.p50), 2) for row in rows.values()] == [1, 2, 3, 4, 5, 6, 7]
    assert rows["put→received"].bound == 0.07
    assert budget.total().mean == 28.0


def test_an_offset_that_is_off_makes_no_negative_stage() -> None:
    budget = LatencyBudget()
    steps = [0, *[NS_PER_MS] * 7]
    # off by 1.5 ms: received half a millisecond before it was put
    budget.record(passage(steps), Offset(-3 * NS_PER_MS // 2, 2 * NS_PER_MS, trusted=True))
    rows = budget.summary()
    assert rows["put→received"].mean == 0.0
    assert rows["received→accepted"].mean == 0.5
    assert budget.total().mean == 5.5


def test_what_passed_while_the_offset_was_not_trusted_is_left_out() -> None:
    budget = LatencyBudget()
    budget.record(passage([0, *[NS_PER_MS] * 7]), Offset(0, 0, trusted=False))
    assert budget.summary()["put→received"] == Summary(0)
    assert budget.total() == Summary(0)


def test_stages_take_one_duration_each() -> None:
    stages = StageTimes("one", "two")
    with pytest.raises(ValueError, match="1 durations for 2 stages"):
        stages.record(5)
    stages.record(NS_PER_MS, 2 * NS_PER_MS)
    assert stages.total().mean == 3.0
    assert stages.summary()["two"].mean == 2.0
