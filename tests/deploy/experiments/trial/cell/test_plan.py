from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import TandemError
from deploy.experiments.trial.cell.plan import CellKey, Setup, TrialPlan, check_continues, merged

PLAN = TrialPlan(
    transports=("tcp", "udp", "quic"),
    profiles=("lan", "4g"),
    strategies=("latest", "predict"),
    repeat=4,
    seconds=20.0,
    outage_s=2.0,
    robot="nursing",
    motion="bottle",
    seed=1,
    router=False,
    max_age_s=0.0,
)


def test_every_setup_is_run_once_a_repeat() -> None:
    cells = PLAN.cells()
    assert len(cells) == len(set(cells)) == 3 * 2 * 2 * 4
    for repetition in range(1, 5):
        turn = cells[(repetition - 1) * 12 : repetition * 12]
        assert {cell.repetition for cell in turn} == {repetition}
        assert {cell.setup for cell in turn} == set(PLAN.setups())


def test_the_order_differs_between_repeats_and_is_reproducible() -> None:
    cells = PLAN.cells()
    turns = {tuple(cell.setup for cell in cells[i * 12 : (i + 1) * 12]) for i in range(4)}
    assert len(turns) == 4
    assert replace(PLAN).cells() == cells
    assert replace(PLAN, seed=2).cells() != cells


def test_no_setup_is_always_among_the_first() -> None:
    """A machine that slows down must not favour one: over many repeats the places even out."""
    many = replace(PLAN, repeat=60)
    places: Counter[Setup] = Counter()
    for i, cell in enumerate(many.cells()):
        places[cell.setup] += i % 12
    means = [total / 60 for total in places.values()]
    assert max(means) - min(means) < 3.0


def test_setups_of_a_repeat_share_their_seed_and_repeats_do_not() -> None:
    seeds = {cell.repetition: {PLAN.seed_of(c) for c in PLAN.cells() if c.repetition == cell.repetition}
             for cell in PLAN.cells()}  # fmt: skip
    assert all(len(of_one) == 1 for of_one in seeds.values())
    assert len(set.union(*seeds.values())) == 4


def test_a_plan_survives_json() -> None:
    assert TrialPlan.of_tree(PLAN.tree()) == PLAN
    with pytest.raises(TandemError, match="another version"):
        TrialPlan.of_tree({"transports": ["tcp"]})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seconds": 21.0}, "seconds was 20.0, is 21.0"),
        ({"outage_s": 0.0}, "outage s was 2.0, is 0.0"),
        ({"motion": "sweep"}, "motion was bottle, is sweep"),
        ({"seed": 2}, "seed was 1, is 2"),
        ({"router": True}, "router was False, is True"),
    ],
)
def test_a_plan_whose_cells_would_not_compare_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(TandemError, match=words):
        check_continues(PLAN, replace(PLAN, **change))  # type: ignore[arg-type]


def test_more_of_the_same_goes_on() -> None:
    wider = replace(PLAN, transports=("udp", "tls"), profiles=("4g", "geo-satellite"), repeat=2)
    both = merged(PLAN, wider)
    assert both.transports == ("tcp", "udp", "quic", "tls")
    assert both.profiles == ("lan", "4g", "geo-satellite")
    assert both.repeat == 4
    assert set(PLAN.cells()) <= set(both.cells())
    assert set(wider.cells()) <= set(both.cells())


@given(st.text(min_size=1, max_size=20), st.integers(1, 99))
def test_a_cells_file_name_is_one_whatever_its_profile_is_called(profile: str, repetition: int) -> None:
    slug = CellKey(Setup("quic-datagram", profile, "predict"), repetition).slug
    assert slug.isascii()
    assert not set(slug) & set("/\\. ")


def test_transports_that_differ_by_a_dash_have_files_of_their_own() -> None:
    slugs = {cell.slug for cell in replace(PLAN, transports=("quic", "quic-datagram", "udp")).cells()}
    assert len(slugs) == 48
