import pytest
from hypothesis import given
from hypothesis import strategies as st

from slave.track.lateness import Lateness


def test_nothing_is_late_before_a_measurement_or_after_a_reset() -> None:
    lateness = Lateness()
    assert lateness.mean_s is None
    assert lateness.late_s == 0.0
    lateness.note(0.1)
    lateness.reset()
    assert lateness.late_s == 0.0


def test_a_steady_link_has_no_spread() -> None:
    lateness = Lateness()
    for _ in range(5):
        lateness.note(0.11)
    assert lateness.late_s == pytest.approx(0.11)


def test_it_follows_a_slower_link_within_seconds() -> None:
    lateness = Lateness()
    for age_s in [0.11] * 20 + [0.23] * 40:
        lateness.note(age_s)
    assert lateness.mean_s == pytest.approx(0.23, abs=1e-3)
    assert lateness.spread_s < 0.01


def test_the_age_after_a_long_silence_counts_as_twice_the_usual_one() -> None:
    silent, twice = Lateness(), Lateness()
    for lateness, age_s in ((silent, 60.0), (twice, 0.2)):
        lateness.note(0.1)
        lateness.note(age_s)
    assert silent.mean_s == twice.mean_s
    assert silent.spread_s == twice.spread_s


def test_a_first_age_of_nothing_is_no_measure_of_the_others() -> None:
    lateness = Lateness()
    for age_s in [-0.01, *[0.2] * 40]:
        lateness.note(age_s)
    assert lateness.mean_s == pytest.approx(0.2)


@given(st.lists(st.floats(-1.0, 100.0), min_size=1, max_size=50))
def test_whatever_comes_it_stays_between_what_was_seen(ages_s: list[float]) -> None:
    lateness = Lateness()
    for age_s in ages_s:
        lateness.note(age_s)
    seen = [max(age_s, 0.0) for age_s in ages_s]
    assert lateness.mean_s is not None
    assert min(seen) - 1e-9 <= lateness.mean_s <= max(seen) + 1e-9
    assert lateness.spread_s >= 0.0
