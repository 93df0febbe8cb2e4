"""Slopes: those of scipy for one stretch, and honest about what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from deploy.measure.trend import FEWEST, in_bins, slope

X = np.arange(60.0)


def noise(seed: int, n: int = 60) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


@given(st.integers(0, 500), st.floats(-2.0, 2.0), st.integers(FEWEST, 60))
def test_one_stretch_is_the_textbook_s(seed: int, rise: float, n: int) -> None:
    x, y = X[:n], rise * X[:n] + noise(seed, n)
    ours, theirs = slope([(x, y)]), stats.theilslopes(y, x, 0.95)
    assert ours is not None
    assert ours.value == pytest.approx(theirs.slope, abs=1e-12)
    # widened, where neighbours resemble each other by chance; never narrower
    assert ours.low <= theirs.low_slope + 1e-12
    assert ours.high >= theirs.high_slope - 1e-12


@given(st.integers(0, 500), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_a_jump_between_stretches_is_no_slope(seed: int, levels: list[float]) -> None:
    stretches = [(X + 100.0 * i, level + noise(seed + i)) for i, level in enumerate(levels)]
    found = slope(stretches)
    assert found is not None
    assert abs(found.value) < 0.03
    assert found.points == 180


def test_an_outlier_moves_nothing() -> None:
    y = 0.5 * X
    y[[5, 40]] += 1e6
    found = slope([(X, y)])
    assert found is not None
    assert found.value == pytest.approx(0.5)


def test_the_truth_lies_in_the_interval_as_often_as_promised() -> None:
    inside = 0
    for seed in range(400):
        found = slope([(X, 0.1 * X + noise(seed)), (X + 100.0, 7.0 + 0.1 * X + noise(seed + 1000))])
        assert found is not None
        inside += found.low <= 0.1 <= found.high
    assert inside >= 0.93 * 400


def test_a_wandering_series_is_mostly_not_called_growing() -> None:
    def called_growing(y: np.ndarray) -> bool:
        found = slope([(np.arange(len(y), dtype=float), y)])
        return found is not None and found.low > 0.0

    related = []
    for seed in range(200):
        steps = noise(seed, 80)
        y = np.zeros(80)
        for i in range(1, 80):
            y[i] = 0.8 * y[i - 1] + steps[i]
        related.append(called_growing(y))
    assert np.mean(related) < 0.08


def test_a_plateau_is_exactly_flat() -> None:
    found = slope([(X, np.full(60, 117.5))])
    assert found is not None
    assert (found.value, found.low, found.high) == (0.0, 0.0, 0.0)


def test_too_few_points_say_nothing() -> None:
    few = FEWEST - 1
    assert slope([(X[:few], X[:few])]) is None
    assert slope([]) is None
    assert slope([(X[: few + 1], np.where(X[: few + 1] == 0.0, np.nan, 1.0))]) is None


def test_bins_hold_medians_and_leave_gaps_out() -> None:
    at_s = np.array([0.0, 1.0, 2.0, 3.0, 21.0, 22.0])
    middles, medians = in_bins(at_s, np.array([1.0, 2.0, np.nan, 9.0, 5.0, 6.0]), 10.0)
    assert middles.tolist() == [5.0, 25.0]
    assert medians.tolist() == [2.0, 5.5]
