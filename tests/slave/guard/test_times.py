"""The guard's times follow the link: slowly, never above the ceiling, never after one outage."""

from __future__ import annotations

import pytest

from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.guard import Guard, GuardConfig
from slave.guard.times import GROWS, GROWS_STANDING, LEAST, SHRINKS
from tests.link_times import CAPTURED_MS, Line, times_over

SECOND = 12
"""Commands of about one."""


def test_a_good_line_is_given_what_the_file_says() -> None:
    line = Line()
    line.send_all([2.0, 9.0, 4.0, 30.0, 5.0] * 100)
    assert (line.age_ms, line.timeout_ms) == (300.0, 200.0)
    assert not line.times.beyond


def test_150_ms_one_way_is_taken_and_told() -> None:
    times = times_over(150.0)
    needed_ms = 150.0 + CAPTURED_MS + 150.0
    assert needed_ms < times.max_age_ns / 1e6 <= needed_ms + 41.0
    said = times.metrics()
    assert said.words.startswith("commands may be 0.35 s old (one way 0.15 s ± 0.15, jitter 0.000)")
    assert said.beyond == ""


def test_400_ms_ends_at_the_ceiling_which_is_named() -> None:
    times = times_over(400.0)
    assert times.max_age_ns == times.ceilings_ns[0] == 600_000_000
    assert "needs max_age_s 0.85 s, the site's ceiling (max_age_ceiling_s) is 0.60 s" in times.beyond


@pytest.mark.parametrize(("moving", "rate"), [(True, GROWS), (False, GROWS_STANDING)])
def test_it_grows_slowly_and_slower_while_the_robot_follows(moving: bool, rate: float) -> None:
    line = Line()
    line.send_all([10.0] * 5 * SECOND, moving=moving)
    before_ms = line.age_ms
    for _ in range(10 * SECOND):
        line.send(200.0, moving=moving)
        assert line.age_ms - before_ms <= rate * 80.0 + 1e-6
        before_ms = line.age_ms
    assert line.age_ms > 350.0


def test_it_shrinks_when_the_line_is_good_again() -> None:
    line = Line()
    line.send_all([200.0] * 30 * SECOND, moving=False)
    assert line.age_ms > 440.0
    before_ms = line.age_ms
    for _ in range(40 * SECOND):
        line.send(5.0)
        assert before_ms - line.age_ms <= SHRINKS * 80.0 + 1e-6
        before_ms = line.age_ms
    assert line.age_ms == 300.0


@pytest.mark.parametrize("outages", [1, 2])
def test_an_outage_of_a_second_teaches_nothing(outages: int) -> None:
    """Nor do the commands that it held back and then brought all at once."""
    line = Line()
    line.send_all([150.0] * 30 * SECOND)
    before = line.age_ms, line.timeout_ms
    for _ in range(outages):
        line.send(1150.0, 1080.0)
        for late_ms in range(1070, 150, -80):
            line.send(float(late_ms), 0.1)
        line.send_all([150.0] * 5 * SECOND)
    assert line.age_ms == pytest.approx(before[0], abs=1.0)
    assert line.timeout_ms == before[1]


def test_gaps_that_come_again_and_again_are_bridged() -> None:
    line = Line()
    for _ in range(40):
        line.send_all([20.0] * 10)
        line.send(20.0, 260.0)
    assert 280.0 <= line.timeout_ms <= 400.0


def test_but_two_of_them_prove_nothing_and_neither_do_gaps_beyond_the_ceiling() -> None:
    line = Line()
    line.send_all([20.0] * 60 * SECOND)
    for gap_ms in (260.0, 260.0, 401.0, 401.0, 401.0, 900.0):
        line.send(20.0, gap_ms)
        line.send_all([20.0] * SECOND)
        assert line.timeout_ms == 200.0
    assert "needs command_timeout_s" in line.times.beyond


def test_a_line_that_somebody_stretches_ever_so_slowly_ends_at_the_ceilings() -> None:
    line = Line()
    way_ms, gap_ms, most = 20.0, 80.0, (0.0, 0.0)
    while gap_ms < 1000.0:
        line.send(way_ms, gap_ms)
        way_ms, gap_ms = way_ms * 1.002, gap_ms + 0.5
        most = max(most[0], line.age_ms), max(most[1], line.timeout_ms)
    assert most[0] == 600.0
    assert 380.0 < most[1] <= 400.0
    assert "max_age_ceiling_s" in line.times.beyond
    assert "command_timeout_ceiling_s" in line.times.beyond


def test_a_burst_is_one_event_and_too_little_to_know() -> None:
    line = Line()
    for _ in range(3 * LEAST):
        line.send(500.0, 0.1, moving=False)
    assert line.times.metrics().one_way_s is None
    assert line.age_ms == 300.0


def test_after_a_silence_longer_than_its_memory_it_begins_anew() -> None:
    line = Line()
    line.send_all([200.0] * 30 * SECOND)
    line.send(200.0, 21_000.0)
    assert (line.age_ms, line.timeout_ms) == (300.0, 200.0)


def test_a_command_that_comes_twice_counts_once_and_a_clock_that_goes_back_forgets() -> None:
    line = Line()
    line.send_all([200.0] * 30 * SECOND, moving=False)
    before_ms = line.age_ms
    line.sequence -= 1
    line.send(5000.0)
    assert line.age_ms == before_ms
    line.sequence += 1
    line.send(200.0, -5000.0)
    assert line.age_ms == 300.0


@pytest.mark.parametrize(
    ("given", "ceilings_s"),
    [
        ({}, (0.6, 0.4)),
        ({"max_age_s": 1.0, "command_timeout_s": 0.5}, (1.0, 0.5)),
        ({"lease_timeout_s": 0.3}, (0.6, 0.3)),
        ({"max_age_ceiling_s": 0.3, "command_timeout_ceiling_s": 0.2}, (0.3, 0.2)),
    ],
)
def test_a_files_ceilings(given: dict[str, float], ceilings_s: tuple[float, float]) -> None:
    config = GuardConfig(**given)  # type: ignore[arg-type]
    assert (config.age_ceiling_s, config.timeout_ceiling_s) == ceilings_s
    Guard("robot-1", load_skeleton("nursing"), config)


@pytest.mark.parametrize("key", ["max_age", "command_timeout"])
def test_a_ceiling_below_what_it_bounds_is_refused(key: str) -> None:
    config = GuardConfig(**{f"{key}_s": 0.5, f"{key}_ceiling_s": 0.4})  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=f"{key}_ceiling_s = 0.4: expected at least {key}_s, 0.5"):
        Guard("robot-1", load_skeleton("nursing"), config)
