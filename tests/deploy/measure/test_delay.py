"""A delay between two motions is found within its own bound, whatever the rates and the noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.clock import NS_PER_MS, NS_PER_S
from deploy.measure.delay import FLOOR_NS, AngularSpeed, MotionDelay, find_delay, speed_of

BEGIN_NS = 7_000 * NS_PER_S


def motion(seed: int, slow_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A person's angular speed, 1 kHz for 30 s: noise below 2 Hz, filtered by a lag of `slow_s`."""
    random = np.random.default_rng(seed)
    at_s = np.arange(0.0, 30.0, 0.001)
    frequencies = random.uniform(0.1, 2.0, 24)
    phases, sizes = random.uniform(0.0, 2 * np.pi, (2, 24)), random.uniform(0.2, 1.0, 24)
    waves = sizes * np.exp(1j * (2 * np.pi * at_s[:, None] * frequencies + phases[0]))
    rate = (waves / (1.0 + 2j * np.pi * frequencies * slow_s)).sum(axis=1)
    return at_s, np.abs(rate)


def sampled(seed: int, late_s: float, rate_hz: float, noise: float, slow_s: float = 0.0) -> AngularSpeed:
    at_s, speed = motion(seed, slow_s)
    random = np.random.default_rng([seed, round(rate_hz)])
    when_s = np.arange(random.uniform(0.0, 0.02), 29.9, 1.0 / rate_hz)
    value = np.interp(when_s, at_s, speed) + noise * random.standard_normal(len(when_s))
    return AngularSpeed(BEGIN_NS + np.round((when_s + late_s) * NS_PER_S).astype(np.int64), value)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    late_ms=st.floats(-250.0, 1400.0),
    rates_hz=st.tuples(st.floats(40.0, 400.0), st.floats(40.0, 400.0)),
    noise=st.floats(0.0, 0.3),
)
def test_a_pure_delay_is_found_within_its_bound(
    seed: int, late_ms: float, rates_hz: tuple[float, float], noise: float
) -> None:
    found = find_delay(
        sampled(seed, 0.0, rates_hz[0], noise), sampled(seed, late_ms / 1e3, rates_hz[1], noise)
    )
    assert isinstance(found, MotionDelay), found
    assert abs(found.delay_ns / NS_PER_MS - late_ms) <= found.bound_ns / NS_PER_MS
    assert found.bound_ns >= FLOOR_NS
    if noise < 0.05:
        assert found.bound_ns < 2 * NS_PER_MS


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), late_ms=st.floats(0.0, 300.0), shift_ms=st.floats(-100.0, 100.0))
def test_it_moves_with_the_stamps_and_is_the_same_backwards(
    seed: int, late_ms: float, shift_ms: float
) -> None:
    first, second = sampled(seed, 0.0, 200.0, 0.02), sampled(seed, late_ms / 1e3, 200.0, 0.02)
    shifted = AngularSpeed(second.at_ns + round(shift_ms * NS_PER_MS), second.rad_s)
    whole, moved, back = (
        find_delay(first, second),
        find_delay(first, shifted),
        find_delay(second, first, (-1.5, 0.3)),
    )
    assert isinstance(whole, MotionDelay)
    assert isinstance(moved, MotionDelay)
    assert isinstance(back, MotionDelay)
    assert moved.delay_ns - whole.delay_ns == pytest.approx(shift_ms * NS_PER_MS, abs=NS_PER_MS / 2)
    assert back.delay_ns == pytest.approx(-whole.delay_ns, abs=NS_PER_MS)


@pytest.mark.parametrize("slow_s", [0.01, 0.02, 0.05])
def test_a_low_pass_counts_about_its_time_constant(slow_s: float) -> None:
    found = find_delay(sampled(3, 0.0, 200.0, 0.02), sampled(3, 0.1, 200.0, 0.02, slow_s))
    assert isinstance(found, MotionDelay)
    assert found.delay_ns / NS_PER_S - 0.1 == pytest.approx(slow_s, rel=0.25)


def test_what_cannot_be_said_is_not_said() -> None:
    first = sampled(1, 0.0, 200.0, 0.02)
    other = sampled(2, 0.0, 200.0, 0.02)
    still = AngularSpeed(first.at_ns, np.full_like(first.rad_s, 0.01))
    short = AngularSpeed(first.at_ns[:1000], first.rad_s[:1000])
    far = AngularSpeed(first.at_ns + 2 * NS_PER_S, first.rad_s)
    wave = AngularSpeed(first.at_ns, 2.0 + np.sin(2 * np.pi * (first.at_ns - BEGIN_NS) / NS_PER_S))
    for pair, why in (
        ((first, other), "not alike"),
        ((still, first), "0 of at least 3 segments"),
        ((short, first), "do not overlap"),
        ((wave, wave), "ambiguous"),
    ):
        found = find_delay(*pair)
        assert isinstance(found, str)
        assert why in found
    assert isinstance(find_delay(first, far), str)


def test_a_gap_is_in_no_segment() -> None:
    first, second = sampled(5, 0.0, 200.0, 0.0), sampled(5, 0.05, 200.0, 0.0)
    heard = (second.at_ns < BEGIN_NS + 9 * NS_PER_S) | (second.at_ns > BEGIN_NS + 11 * NS_PER_S)
    found = find_delay(first, AngularSpeed(second.at_ns[heard], second.rad_s[heard]))
    whole = find_delay(first, second)
    assert isinstance(found, MotionDelay)
    assert isinstance(whole, MotionDelay)
    assert found.segments < whole.segments
    assert found.delay_ns == pytest.approx(50 * NS_PER_MS, abs=found.bound_ns)


def test_orientations_give_their_angular_speed() -> None:
    at_ns = BEGIN_NS + np.arange(100) * 20 * NS_PER_MS
    angle = 1.5 * (at_ns - BEGIN_NS) / NS_PER_S
    zero, one = np.zeros(100), np.ones(100)
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.moveaxis(np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]), 2, 0)
    twice = np.concatenate([turn[:50], turn[49:]]), np.concatenate([at_ns[:50], at_ns[49:]])
    speed = speed_of(twice[1], twice[0])
    assert len(speed.at_ns) == 99
    assert speed.rad_s == pytest.approx(1.5)
    assert speed.at_ns[0] == BEGIN_NS + 10 * NS_PER_MS
