import pytest

from deploy.measure.timing import spread, spread_us, time_calls, total


def test_a_spread_tells_least_median_and_tail() -> None:
    figures = spread(list(range(101)))
    assert figures == {"min": 0.0, "median": 50.0, "p99": 99.0, "max": 100.0, "count": 101}


def test_a_spread_of_nothing_is_no_figure() -> None:
    assert spread([]) == {"count": 0}


def test_nanoseconds_are_told_in_microseconds() -> None:
    assert spread_us([1500.0])["median"] == 1.5


@pytest.mark.parametrize("batch", [1, 7])
def test_calls_are_timed_by_the_call(batch: int) -> None:
    calls = 0

    def call() -> None:
        nonlocal calls
        calls += 1

    figures = time_calls(call, 0.01, batch)
    assert calls == 1 + batch * figures["count"]
    assert figures["min"] <= figures["median"] <= figures["p99"] <= figures["max"]


def test_a_total_needs_all_its_parts() -> None:
    assert total([1.0, 2.5]) == 3.5
    assert total([1.0, None]) is None
