"""Latency that creeps is an alarm with its confidence; noise, outliers and waves are none."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import to_ns
from common.quaternion import Array
from deploy.console.model.creep import BLOCK_S, LEAST_MS, WINDOW_S, Creep, CreepWatch, theil_sen

SECONDS = np.arange(WINDOW_S + BLOCK_S + 1)


def judged(values_ms: Array) -> Creep:
    watch = CreepWatch()
    for second, value in enumerate(values_ms.tolist()):
        watch.add(second, value)
    assert watch.newest is not None
    return watch.newest


def noise(seed: int, together_s: float = 0.0) -> Array:
    """Latency as links have it: a heavy tail above 40 ms, neighbouring seconds alike where asked."""
    rng = np.random.default_rng(seed)
    white = rng.gamma(2.0, 1.5, len(SECONDS))
    if together_s:
        kept = np.exp(-1.0 / together_s)
        for i in range(1, len(white)):
            white[i] = kept * white[i - 1] + (1.0 - kept) * white[i]
    return 40.0 + white


def test_a_creep_is_found_with_its_slope_inside_its_interval() -> None:
    within = 0
    for seed in range(40):
        found = judged(noise(seed) + 1.0 * SECONDS / 60.0)
        assert found.alarm
        assert "99 % confidence" in found.words
        within += found.low <= 1.0 <= found.high
    assert within >= 38, "99 % should be"


@pytest.mark.parametrize("together_s", [0.0, 10.0])
def test_noise_alarms_nobody(together_s: float) -> None:
    found = [judged(noise(seed, together_s)) for seed in range(200)]
    assert not any(one.alarm for one in found)
    certain = sum(one.low > 0.0 or one.high < 0.0 for one in found)
    assert certain <= 10, "and the interval leaves out 0 in few of them"


def test_a_rise_that_is_certain_but_small_alarms_nobody() -> None:
    just_below = judged(40.0 + 0.98 * LEAST_MS * SECONDS / WINDOW_S)
    assert just_below.low > 0.0
    assert not just_below.alarm
    assert judged(40.0 + 1.02 * LEAST_MS * SECONDS / WINDOW_S).alarm


def test_of_a_long_line_a_tenth_must_be_risen() -> None:
    assert not judged(300.0 + 20.0 * SECONDS / WINDOW_S).alarm
    assert judged(300.0 + 40.0 * SECONDS / WINDOW_S).alarm


def test_outliers_and_waves_are_no_creep() -> None:
    spikes = noise(1)
    spikes[500:540:4] += 400.0
    assert not judged(spikes).alarm
    assert not judged(noise(2) + 10.0 * np.sin(2.0 * np.pi * SECONDS / 120.0)).alarm


def test_what_falls_is_no_alarm() -> None:
    found = judged(noise(1) - 1.0 * SECONDS / 60.0)
    assert found.high < 0.0
    assert not found.alarm


def test_it_says_nothing_before_it_knows_enough_and_forgets_what_is_old() -> None:
    watch = CreepWatch()
    for second in range(15 * BLOCK_S):
        watch.add(second, 40.0)
    assert watch.newest is None, "fourteen whole blocks"
    watch.add(15 * BLOCK_S, 40.0)
    assert watch.newest is not None
    assert watch.look(to_ns(16.0 * BLOCK_S)) is watch.newest
    assert watch.look(to_ns(19.0 * BLOCK_S)) is None
    watch.add(10_000, 40.0)
    assert watch.newest is None, "all before is older than ten minutes"


def test_blocks_of_which_little_is_known_do_not_count() -> None:
    watch = CreepWatch()
    for block in range(21):
        for second in range(9):
            watch.add(BLOCK_S * block + second, 40.0 + block)
    assert watch.newest is None


def test_the_slope_is_the_median_of_all_pairs() -> None:
    found = theil_sen([0, 1, 2, 3], [0.0, 1.0, 2.0, 30.0])
    pairs = [1.0, 1.0, 10.0, 1.0, 14.5, 28.0]  # by hand, a block
    assert found.slope == pytest.approx(np.median(pairs) * 60.0 / BLOCK_S)
