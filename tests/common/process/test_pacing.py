import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.process.pacing import DueTick, TickGrid


def test_a_tick_is_due_at_its_time_and_not_before() -> None:
    grid = TickGrid(origin_ns=1000, period_ns=10)
    assert grid.due(999) is None
    assert grid.due(1000) == DueTick(0, 1000, 0)
    assert grid.due(1009) is None
    assert grid.next_ns == 1010
    assert grid.due(1010) == DueTick(1, 1010, 0)


def test_a_late_loop_gets_the_newest_tick_and_the_count_of_the_missed() -> None:
    grid = TickGrid(0, 10)
    grid.due(0)
    assert grid.due(49) == DueTick(4, 40, 3)
    assert grid.due(49) is None
    assert grid.due(50) == DueTick(5, 50, 0)


@given(
    st.integers(-(10**18), 10**18),
    st.integers(1, 10**9),
    st.lists(st.integers(0, 10**10), min_size=1, max_size=100),
)
def test_every_tick_is_run_or_missed_once_and_none_drifts(
    origin: int, period: int, pauses: list[int]
) -> None:
    grid = TickGrid(origin, period)
    now, seen = origin, 0
    for pause in pauses:
        now += pause
        due = grid.due(now)
        if due is None:
            assert now < grid.next_ns
            continue
        assert due.scheduled_ns == origin + due.tick * period
        assert 0 <= now - due.scheduled_ns < period
        seen += 1 + due.missed
        assert seen == due.tick + 1


@pytest.mark.parametrize("period", [0, -1])
def test_a_period_must_be_positive(period: int) -> None:
    with pytest.raises(ValueError, match="period_ns must be positive"):
        TickGrid(0, period)
