import numpy as np

from common.quaternion import Array
from master.calibrate.still import (
    distinct_attitudes,
    interval_means,
    motion_level,
    still_intervals,
    stillest_level,
)

RATE_HZ = 100.0
BIAS: Array = np.array([0.1, -0.2, 0.05])


def rates(*seconds_and_speeds: tuple[float, float]) -> Array:
    """Stretches of an even turn each, with bias and noise."""
    speed = np.concatenate([np.full(round(s * RATE_HZ), v) for s, v in seconds_and_speeds])
    noise = np.random.default_rng(0).normal(scale=2e-3, size=(len(speed), 3))
    readings: Array = speed[:, None] * np.array([0.6, 0.0, 0.8]) + BIAS + noise
    return readings


def found(gyr: Array, shortest_s: float = 2.0) -> list[list[int]]:
    level = motion_level(gyr, RATE_HZ)
    rest = stillest_level(level, 1e-4)
    out: list[list[int]] = still_intervals(level, 4 * rest, RATE_HZ, shortest_s).tolist()
    return out


def test_rests_are_found_and_their_ends_cut() -> None:
    intervals = found(rates((5, 0), (2, 1.0), (4, 0), (1, 0.5), (6, 0)))
    assert len(intervals) == 3
    for (a, b), (first, last) in zip(intervals, [(0, 500), (700, 1100), (1200, 1800)], strict=True):
        assert first + 25 <= a <= first + 75
        assert last - 75 <= b <= last - 20


def test_a_slow_even_turn_is_no_rest() -> None:
    """It varies as little as a rest: only the bias tells."""
    intervals = found(rates((10, 0), (3, 0.05), (10, 0)))
    assert len(intervals) == 2


def test_a_short_rest_is_none() -> None:
    assert len(found(rates((5, 0), (1, 1.0), (1.8, 0), (1, 1.0), (5, 0)))) == 2


def test_missing_samples_end_a_rest() -> None:
    gyr = rates((10, 0), (1, 1.0))
    gyr[500:510] = np.nan
    intervals = found(gyr)
    assert len(intervals) == 2
    assert intervals[0][1] <= 500
    assert intervals[1][0] >= 510


def test_no_noise_at_all() -> None:
    gyr = np.zeros((1000, 3))
    gyr[400:600] = 1.0
    level = motion_level(gyr, RATE_HZ)
    assert len(still_intervals(level, 2 * stillest_level(level, 1e-3), RATE_HZ, 2.0)) == 2


def test_means_leave_out_what_is_missing() -> None:
    samples = np.arange(30.0).reshape(10, 3)
    samples[1] = np.nan
    means = interval_means(samples, np.array([[0, 3], [4, 5]]))
    assert np.allclose(means, [(samples[0] + samples[2]) / 2, samples[4]])


def test_attitudes_are_counted_once() -> None:
    angle = np.radians([0.0, 5.0, 40.0, 44.0, 90.0, 2.0])
    assert distinct_attitudes(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])) == 3
