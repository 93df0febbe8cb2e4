"""Durations, counters, windows, verdicts: the pure parts that fit on a screen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError
from common.latency.durations import Durations
from deploy.experiments.soak.command import soak
from deploy.experiments.soak.counts import Additions
from deploy.experiments.soak.faults import FAULTS, chosen
from deploy.experiments.soak.files.options import in_words, seconds
from deploy.experiments.soak.judge.growth import not_above
from deploy.experiments.soak.judge.windows import AFTER_S, BEFORE_S, Window, explained, reason
from deploy.measure.trend import Slope
from deploy.measure.verdict import Outcome, at_most


@pytest.mark.parametrize(
    ("text", "expected"),
    [("8h", 28800.0), ("30m", 1800.0), ("90s", 90.0), ("1h30m", 5400.0), ("45", 45.0), ("1.5 min", 90.0)],
)
def test_durations(text: str, expected: float) -> None:
    assert seconds(text) == expected


@pytest.mark.parametrize("text", ["", "soon", "5s", "8 hours", "-3m", "1h and a bit", "nan"])
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"--duration = .*expected a time such as 8h, 30m or 90s"):
        seconds(text)


def test_durations_in_words() -> None:
    assert [in_words(s) for s in (3.4, 61.0, 3909.0)] == ["3 s", "1 min 01 s", "1 h 05 min 09 s"]


@given(st.lists(st.lists(st.integers(0, 50), min_size=1, max_size=10), min_size=1, max_size=5))
def test_additions_over_several_lives_are_all_that_was_counted(lives: list[list[int]]) -> None:
    total = 0.0
    for life in lives:
        added, value = Additions(), 0
        for step in life:
            value += step
            total += added.take("x", value)
    assert total == sum(sum(life) for life in lives)


def test_a_counter_that_fell_is_of_a_new_process() -> None:
    added = Additions()
    assert [added.take("x", value) for value in (3, 5, 2, 2)] == [3.0, 2.0, 2.0, 0.0]


@given(st.lists(st.lists(st.integers(1, 10**7), min_size=1, max_size=20), min_size=1, max_size=5))
def test_the_mean_of_each_look_is_that_of_what_came_since(looks: list[list[int]]) -> None:
    durations, added = Durations(), Additions()
    for look in looks:
        for duration_ns in look:
            durations.record(duration_ns)
        count, mean = added.mean("x", durations.summary())
        assert count == len(look)
        assert mean == pytest.approx(np.mean(look) / 1e6, rel=1e-6, abs=1e-9)
    count, mean = added.mean("x", durations.summary())
    assert count == 0
    assert math.isnan(mean)


windows = st.lists(
    st.builds(lambda a, b: Window(a, a + b, "w"), st.floats(0, 100), st.floats(0, 20)), max_size=6
)


@given(windows, st.lists(st.floats(-10, 150), min_size=1, max_size=20))
def test_the_mask_agrees_with_each_window(windows: list[Window], times: list[float]) -> None:
    expected = [any(w.includes(t) for w in windows) for t in times]
    assert explained(np.array(times), windows).tolist() == expected


def test_a_window_s_ends() -> None:
    window = Window(10.0, 20.0, "kill")
    inside = (10.0 - BEFORE_S, 10.0, 20.0 + AFTER_S)
    assert all(window.includes(t) for t in inside)
    assert not any(window.includes(t) for t in (inside[0] - 0.01, inside[-1] + 0.01))
    assert (reason(15.0, [window]), reason(30.0, [window])) == ("kill", "")


@pytest.mark.parametrize(
    ("low", "high", "status"),
    [
        (-1.0, 0.5, Outcome.PASSED),
        (-1.0, 0.51, Outcome.NOT_JUDGED),
        (0.5, 2.0, Outcome.NOT_JUDGED),
        (0.51, 2.0, Outcome.FAILED),
        (-3.0, -1.0, Outcome.PASSED),
    ],
)
def test_growth_is_judged_by_its_whole_interval(low: float, high: float, status: Outcome) -> None:
    found = Slope((low + high) / 2.0, low, high, 50)
    assert not_above(at_most("grows", None, 0.5, "MB/h"), found).outcome is status


def test_no_slope_says_that_it_was_too_short() -> None:
    verdict = not_above(at_most("grows", None, 0.5, why="too short: 20 s"), None)
    assert (verdict.outcome, verdict.why) == (Outcome.NOT_JUDGED, "too short: 20 s")


def test_faults_are_chosen_by_name() -> None:
    assert chosen("all") == list(FAULTS)
    assert chosen("none") == []
    assert chosen("suit-kill, disk-full,suit-kill") == ["suit-kill", "disk-full"]
    with pytest.raises(ConfigError, match="--faults = 'flood': expected all, none or some of master-kill"):
        chosen("flood")


def test_the_list_of_faults_fits_80_columns(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    soak(faults="help")
    printed = capsys.readouterr().out
    assert [name for name in FAULTS if name not in printed] == []
    assert max(map(len, printed.splitlines())) <= 80
