from __future__ import annotations

from common.log.throttle import LogThrottle


def test_it_passes_at_once_then_once_a_period_and_counts_the_rest() -> None:
    throttle = LogThrottle(period_ns=100)
    times = [0, 1, 99, 100, 101, 250, 349, 350]
    assert [throttle.passes(t) for t in times] == [1, 0, 0, 3, 0, 2, 0, 2]


def test_each_kind_has_its_own_period() -> None:
    throttle = LogThrottle(period_ns=100)
    assert throttle.passes(5, "a") == 1
    assert throttle.passes(6, "b") == 1
    assert throttle.passes(7, "a") == 0
