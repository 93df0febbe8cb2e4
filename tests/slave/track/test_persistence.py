import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slave.track.persistence import LEAST_S, MOST_S, Persistence, steadiness

MS = 1_000_000


def learnt(rate_hz: float, swing_hz: float, by_rad_s: float = 1.0, seconds: float = 20.0) -> Persistence:
    persistence = Persistence()
    for k in range(round(seconds * rate_hz)):
        t_s = k / rate_hz
        persistence.note(round(t_s * 1e9), np.array([by_rad_s * np.cos(2.0 * np.pi * swing_hz * t_s)]))
    return persistence


@pytest.mark.parametrize("swing_hz", [0.3, 0.7, 1.5])
def test_it_is_alike_at_every_rate_of_commands(swing_hz: float) -> None:
    found = [float(learnt(rate_hz, swing_hz).omega_per_s[0]) for rate_hz in (12.5, 25.0, 50.0)]
    assert max(found) < 1.05 * min(found)
    # differenced over 80 ms, a swing looks slower by sin(x) / x
    x = np.pi * swing_hz * 0.08
    assert found[0] == pytest.approx(2.0 * np.pi * swing_hz * np.sin(x) / x, rel=0.08)


def test_noise_counts_alike_at_every_rate() -> None:
    found = []
    for rate_hz in (12.5, 25.0, 50.0):
        persistence, random = Persistence(), np.random.default_rng(2)
        for k in range(round(20.0 * rate_hz)):
            swing = np.cos(2.0 * np.pi * 0.5 * k / rate_hz)
            persistence.note(round(k / rate_hz * 1e9), np.array([swing + 0.2 * random.standard_normal()]))
        found.append(float(persistence.omega_per_s[0]))
    assert max(found) < 1.1 * min(found)


def test_a_joint_that_stands_is_neither_restless_nor_more_than_even() -> None:
    still = Persistence()
    random = np.random.default_rng(1)
    for k in range(200):
        still.note(80 * k * MS, np.radians(0.1) * random.standard_normal(1))
    assert still.lasts_s[0] == pytest.approx(Persistence().lasts_s, rel=0.1)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.integers(1, 900), st.floats(-20.0, 20.0)), min_size=1, max_size=60))
def test_it_stays_within_its_bounds_whatever_comes(samples: list[tuple[int, float]]) -> None:
    persistence, now_ms = Persistence(), 0
    for gap_ms, velocity in samples:
        now_ms += gap_ms
        persistence.note(now_ms * MS, np.array([velocity]))
        assert LEAST_S <= float(np.max(persistence.lasts_s)) <= MOST_S


def test_nothing_is_differenced_over_a_long_silence() -> None:
    one, two = learnt(12.5, 0.5), learnt(12.5, 0.5)
    two.note(60_000 * MS, np.array([-5.0]))
    assert float(two.omega_per_s[0]) < float(one.omega_per_s[0])


def test_a_joint_that_moves_for_the_first_time_is_expected_to_move_as_the_others() -> None:
    persistence = Persistence()
    for k in range(150):
        both = np.array([np.cos(2.0 * np.pi * 1.5 * 0.08 * k), 0.0])
        persistence.note(80 * k * MS, both)
    moves, still = persistence.omega_per_s
    assert still == pytest.approx(moves, rel=0.05)


def test_a_reset_forgets_the_movement() -> None:
    persistence = learnt(12.5, 2.0)
    persistence.reset()
    assert persistence.lasts_s == Persistence().lasts_s


def test_steadiness_rises_with_the_time_a_movement_lasts() -> None:
    np.testing.assert_allclose(steadiness(np.array([LEAST_S, 0.1, 0.13, 0.16, MOST_S])), [0, 0, 0.5, 1, 1])
