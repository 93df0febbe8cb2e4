"""Two taps on a still segment are a sign; walking, clapping, arm motion and single blows are none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array
from master.suit.double_tap import DoubleTap, TapLimits, double_taps

RATE_HZ = 200.0
BLOW = np.array([35.0, -25.0, 12.0, -8.0, 5.0])
"""What a finger's blow adds along one axis, m/s², sample by sample."""


def still(seconds: float) -> tuple[Array, Array]:
    ticks = round(seconds * RATE_HZ)
    rng = np.random.default_rng(3)
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.1, (ticks, 3))
    return acc, rng.normal(0.0, 0.05, (ticks, 3))


def tapped(at_s: Sequence[float], seconds: float = 4.0, size: float = 1.0) -> tuple[Array, Array]:
    acc, gyr = still(seconds)
    for t in at_s:
        first = round(t * RATE_HZ)
        acc[first : first + len(BLOW), 2] += size * BLOW
    return acc, gyr


def found(acc: Array, gyr: Array, limits: TapLimits | None = None) -> list[float]:
    return [float(t) for t in double_taps(acc, gyr, RATE_HZ, limits)]


@pytest.mark.parametrize("apart_s", [0.205, 0.3, 0.45, 0.595])
def test_two_taps_are_a_double_tap_once_nothing_follows(apart_s: float) -> None:
    (at_s,) = found(*tapped([1.0, 1.0 + apart_s]))
    assert at_s == pytest.approx(1.0 + apart_s + TapLimits().alone_s, abs=0.011)


@pytest.mark.parametrize(
    "at_s",
    [[1.0], [1.0, 1.19], [1.0, 1.61], [1.0, 1.4, 1.8], [0.5, 1.0, 1.4], [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]],
    ids=["one", "too soon", "too late", "three", "one before", "a row"],
)
def test_any_other_number_or_distance_is_none(at_s: list[float]) -> None:
    assert found(*tapped(at_s, seconds=5.0)) == []


def test_a_soft_touch_is_none() -> None:
    size = (TapLimits().blow_m_s2 - 1.0) / BLOW[0]
    assert found(*tapped([1.0, 1.4], size=size)) == []
    assert found(*tapped([1.0, 1.4], size=1.1 * size)) != []


def test_claps_are_none_since_the_hand_flies_before_it_meets_the_other() -> None:
    acc, gyr = tapped([1.0, 1.4])
    for t in (1.0, 1.4):
        first = round(t * RATE_HZ)
        gyr[first - 30 : first, 0] += 4.0
    assert found(acc, gyr) == []


def test_a_blow_that_does_not_end_is_none() -> None:
    acc, gyr = tapped([1.0, 1.4])
    first = round(1.0 * RATE_HZ)
    gyr[first : first + 60, 1] += 3.0
    assert found(acc, gyr) == []


MUTANTS: dict[str, tuple[TapLimits, Callable[[], tuple[Array, Array]]]] = {
    "not calm before": (TapLimits(before_s=0.0), lambda: clap()),
    "no matter what follows": (TapLimits(alone_s=0.0), lambda: tapped([1.0, 1.4, 1.8])),
    "however soft": (TapLimits(blow_m_s2=5.0), lambda: tapped([1.0, 1.4], size=0.5)),
}


def clap() -> tuple[Array, Array]:
    acc, gyr = tapped([1.0, 1.4])
    for t in (1.0, 1.4):
        first = round(t * RATE_HZ)
        gyr[first - 20 : first - 6, 0] += 4.0
    return acc, gyr


@pytest.mark.parametrize("name", MUTANTS)
def test_a_watch_that_lacks_a_limit_takes_it_for_a_double_tap(name: str) -> None:
    limits, motion = MUTANTS[name]
    assert found(*motion()) == []
    assert found(*motion(), limits) != []


def test_a_node_that_was_silent_for_a_while_does_not_join_taps() -> None:
    watch = DoubleTap()
    acc, gyr = tapped([1.0, 1.4], seconds=3.0)
    for tick in range(round(1.3 * RATE_HZ)):
        assert not watch.take(acc[tick], gyr[tick], tick * 5_000_000)
    later_ns = 10_000_000_000
    for tick in range(round(1.3 * RATE_HZ), len(acc)):
        assert not watch.take(acc[tick], gyr[tick], later_ns + tick * 5_000_000)


def test_a_real_person_who_walks_reaches_and_gestures_taps_nothing(recording: Any) -> None:
    data = recording("human_full_body")
    names = [key.removesuffix("_acc") for key in data if key.endswith("_acc")]
    assert len(names) == 16
    for blow_m_s2 in (10.0, 20.0):
        for name in names:
            acc, gyr = (np.asarray(data[f"{name}_{kind}"], np.float64) for kind in ("acc", "gyr"))
            taps = double_taps(acc, gyr, 100.0, TapLimits(blow_m_s2=blow_m_s2))
            assert len(taps) == 0, f"{name} at {blow_m_s2} m/s²: {taps}"


def test_two_real_taps_are_found_and_single_ones_are_not(recording: Any) -> None:
    data = recording("broad_25_disturbed_tapping_B")
    rate_hz = float(data["rate_hz"])
    acc, gyr = np.asarray(data["acc"], np.float64), np.asarray(data["gyr"], np.float64)
    assert len(double_taps(acc, gyr, rate_hz)) == 0, "they come every few seconds"
    first, length = round(56.8 * rate_hz), round(0.4 * rate_hz)
    tap = slice(first, first + length)
    rest = slice(first - round(1.5 * rate_hz), first)
    twice = [np.concatenate([x[rest], x[tap], x[tap], x[rest]]) for x in (acc, gyr)]
    assert len(double_taps(twice[0], twice[1], rate_hz)) == 1
