"""What grows is told from what jumps, warms up or is of another life; what is too short is said to be."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from deploy.experiments.soak.files.events import AnyEvent
from deploy.experiments.soak.judge.evidence import SoakEvidence
from deploy.experiments.soak.judge.growth import (
    DRIFT_MS_H,
    MORE,
    RSS_MB_H,
    SHORTEST_S,
    WARM_UP_S,
    drift,
    handles,
    in_use,
    memory,
)
from deploy.measure.verdict import Outcome, Verdict
from tests.deploy.experiments.soak.conftest import FAULT, RECOVERED, STORY, Make, happened

LONG = 3600


def of(verdicts: list[Verdict], words: str) -> Verdict:
    [found] = [verdict for verdict in verdicts if words in verdict.name]
    return found


def rss(seen: SoakEvidence) -> Verdict:
    return of(memory(seen), "master's memory")


def growing(mb_h: float, noise: float = 0.02) -> object:
    random = np.random.default_rng(3)
    return lambda at_s: 100.0 + mb_h * at_s / 3600.0 + noise * random.standard_normal(len(at_s))


def test_memory_that_stays_passes_and_a_leak_fails(make: Make) -> None:
    assert rss(make(LONG, master_rss_mb=growing(0.0))).outcome is Outcome.PASSED
    leak = rss(make(LONG, master_rss_mb=growing(3.0 * RSS_MB_H)))
    assert leak.outcome is Outcome.FAILED
    assert leak.measured == pytest.approx(3.0 * RSS_MB_H, rel=0.1)


def test_the_first_minutes_of_a_life_are_its_own_affair(make: Make) -> None:
    def warming(at_s: Array) -> Array:
        out: Array = 100.0 - 30.0 * np.exp(-at_s / 15.0)
        return out

    assert rss(make(LONG, master_rss_mb=warming)).outcome is Outcome.PASSED


def test_another_life_s_level_is_no_growth(make: Make) -> None:
    lives = {
        "master_life": lambda at_s: 1.0 + at_s // 900,
        "master_rss_mb": lambda at_s: 100.0 + 10.0 * (at_s // 900) + 0.01 * np.sin(at_s),
    }
    assert rss(make(LONG, **lives)).outcome is Outcome.PASSED


def test_a_leak_in_every_life_is_found_though_each_begins_anew(make: Make) -> None:
    lives = {
        "master_life": lambda at_s: 1.0 + at_s // 900,
        "master_rss_mb": lambda at_s: 100.0 + 10.0 * (at_s % 900) / 3600.0 + 0.01 * np.sin(at_s),
    }
    assert rss(make(LONG, **lives)).outcome is Outcome.FAILED


def many_faults(seconds: int, every_s: int) -> tuple[AnyEvent, ...]:
    begins = range(200, seconds - 100, every_s)
    faults = [(float(s), FAULT | {"begun_s": float(s), "number": n}) for n, s in enumerate(begins)]
    told = [happened(s, "fault", what) for s, what in faults]
    return (*STORY[:6], *told, *(happened(s + 5.0, "recovered", RECOVERED | what) for s, what in faults))


def test_what_each_fault_costs_is_told_apart_from_what_grows_with_time(make: Make) -> None:
    events = many_faults(LONG, 100)

    def stepping(at_s: Array) -> Array:
        return 100.0 + 0.2 * np.maximum(0.0, (at_s - 100.0) // 100)

    def between(seen: SoakEvidence) -> Verdict:
        return of(memory(seen), "master grows between faults")

    steps = make(LONG, events, master_rss_mb=stepping)
    assert rss(steps).outcome is Outcome.FAILED
    assert between(steps).outcome is Outcome.PASSED
    leak = between(make(LONG, events, master_rss_mb=growing(3.0 * RSS_MB_H, noise=0.001)))
    assert leak.outcome is Outcome.FAILED
    assert leak.measured == pytest.approx(3.0 * RSS_MB_H, rel=0.1)
    assert not [v for v in memory(make(LONG, STORY[:6])) if "between" in v.name]


def test_short_lives_are_not_judged_and_it_is_said(make: Make) -> None:
    short = rss(make(int(WARM_UP_S + SHORTEST_S) - 10))
    assert short.outcome is Outcome.NOT_JUDGED
    assert "too short" in short.why
    assert rss(make(int(WARM_UP_S + SHORTEST_S) + 20)).outcome is Outcome.PASSED


def test_drift_counts_only_outside_of_faults(make: Make) -> None:
    def slow_in_the_fault(at_s: Array) -> Array:
        return np.where((at_s >= 100.0) & (at_s <= 111.0), 80.0, 0.5)

    assert of(drift(make(LONG, one_way_p50_ms=slow_in_the_fault)), "one way").outcome is Outcome.PASSED
    drifting = make(LONG, one_way_p50_ms=lambda at_s: 0.5 + 4.0 * DRIFT_MS_H * at_s / 3600.0)
    assert of(drift(drifting), "one way").outcome is Outcome.FAILED


def test_each_pair_of_lives_has_its_own_offset_between_the_clocks(make: Make) -> None:
    lives = {
        "master_life": lambda at_s: 1.0 + at_s // 1800,
        "one_way_p50_ms": lambda at_s: 0.5 + 0.3 * (at_s // 1800) + 0.001 * np.sin(at_s),
    }
    assert of(drift(make(LONG, **lives)), "one way").outcome is Outcome.PASSED


def test_what_was_not_measured_is_not_judged(make: Make) -> None:
    assert of(drift(make(LONG)), "round trip").outcome is Outcome.NOT_JUDGED


def test_descriptors_are_held_against_those_after_the_warm_up(make: Make) -> None:
    def more(gained: float) -> object:
        return lambda at_s: 20.0 + gained * (at_s > 400.0)

    fds = "master's descriptors"
    assert of(handles(make(600, master_fds=more(MORE))), fds).outcome is Outcome.PASSED
    assert of(handles(make(600, master_fds=more(MORE + 1.0))), fds).outcome is Outcome.FAILED
    assert of(handles(make(200, master_fds=more(0.0))), fds).outcome is Outcome.NOT_JUDGED


def test_a_leak_of_0_6_mb_an_hour_fails_within_half_an_hour(
    make: Make,
) -> None:
    half = 1800
    hidden = make(half, master_rss_mb=growing(0.0), master_in_use_mb=growing(0.6, noise=0.01))
    assert rss(hidden).outcome is Outcome.PASSED, "the reserve that was touched at the start takes it up"
    assert of(in_use(hidden), "master's bytes in use").outcome is Outcome.FAILED
    # objects of 64 bytes that Python itself allocates: C counts none of them
    blocks = make(half, slave_blocks=lambda at_s: 3e5 + 0.6e6 / 64 * at_s / 3600.0)
    assert of(in_use(blocks), "slave's objects in use").outcome is Outcome.FAILED
    assert of(in_use(make(half)), "slave's objects in use").outcome is Outcome.PASSED
    assert of(in_use(make(half, slave_blocks=np.nan)), "slave's objects").outcome is Outcome.NOT_JUDGED
