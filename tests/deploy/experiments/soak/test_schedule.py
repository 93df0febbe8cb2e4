"""Every plan keeps its distances, gives every kind its turn, and leaves the calm part to the gentle ones."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from deploy.experiments.soak.schedule import (
    CALM_FROM_S,
    LONGEST_S,
    SETTLE_S,
    SHORTEST_S,
    SPREAD,
    TAIL_S,
    calm_from_s,
    distance_s,
    schedule,
)

KINDS = ("kill", "loss", "clock", "full", "outage")
ENDERS = ("kill", "clock", "full")

durations = st.floats(10.0, 8 * 3600.0)
distances = st.floats(5.0, 300.0)
kinds = st.lists(st.sampled_from(KINDS), unique=True)


@given(durations, kinds, distances, st.integers(0, 1000))
def test_distances_ends_and_the_calm_part_are_kept(
    duration_s: float, kinds: list[str], every_s: float, seed: int
) -> None:
    planned = schedule(duration_s, kinds, ENDERS, every_s, seed)
    times = [p.at_s for p in planned]
    gaps = [after - before for before, after in pairwise(times)]
    assert all(every_s * (1 - SPREAD) - 0.01 <= gap <= every_s * (1 + SPREAD) + 0.01 for gap in gaps)
    assert all(SETTLE_S <= at_s <= duration_s - TAIL_S + 0.01 for at_s in times)
    assert not [p for p in planned if p.fault in ENDERS and p.at_s >= calm_from_s(duration_s) + 0.01]
    assert planned == schedule(duration_s, kinds, ENDERS, every_s, seed)


@given(kinds, st.integers(0, 1000))
def test_no_kind_comes_twice_before_every_other_came_once(kinds: list[str], seed: int) -> None:
    planned = [p.fault for p in schedule(CALM_FROM_S - 1.0, kinds, ENDERS, 20.0, seed)]
    rounds = [planned[i : i + len(kinds)] for i in range(0, len(planned), max(1, len(kinds)))]
    assert all(Counter(one) == Counter(kinds) for one in rounds[:-1])


def test_another_seed_is_another_plan() -> None:
    assert schedule(600.0, KINDS, ENDERS, 20.0, 1) != schedule(600.0, KINDS, ENDERS, 20.0, 2)


def test_no_kind_no_plan() -> None:
    assert schedule(3600.0, [], ENDERS, 20.0, 1) == []
    calm = schedule(3600.0, ["kill"], ENDERS, 60.0, 1)
    assert calm
    assert calm[-1].at_s < 0.6 * 3600.0


def test_half_an_hour_sees_ten_kinds_and_ends_calmly() -> None:
    kinds = [f"kind {i}" for i in range(10)]
    planned = schedule(1800.0, kinds, kinds[:8], distance_s(1800.0, 10), 1)
    assert {p.fault for p in planned} == set(kinds)
    assert {p.fault for p in planned if p.at_s >= 1080.0} == set(kinds[8:])


def test_the_distance_is_bounded() -> None:
    assert distance_s(60.0, 10) == SHORTEST_S
    assert distance_s(1800.0, 10) == 90.0
    assert distance_s(8 * 3600.0, 10) == LONGEST_S
    assert distance_s(100.0, 0) == 100.0
