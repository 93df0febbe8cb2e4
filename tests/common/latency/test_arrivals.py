"""Numbers that are missing, late or come twice, held against a plain account of all of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.latency.arrivals import REMEMBERED, Arrivals
from common.metrics.slave import ArrivalCounts


def noted(*sequences: int, lease: int = 7) -> Arrivals:
    arrivals = Arrivals()
    for sequence in sequences:
        arrivals.note(lease, sequence)
    return arrivals


def test_nothing_is_missing_in_an_unbroken_row_wherever_it_begins() -> None:
    assert noted(*range(41, 60)).metrics() == ArrivalCounts(19, 0, 0, 0)


def test_a_gap_is_lost_a_late_one_is_not_and_a_copy_is_a_repetition() -> None:
    assert noted(1, 2, 5).metrics() == ArrivalCounts(3, 2, 0, 0)
    assert noted(1, 2, 5, 4).metrics() == ArrivalCounts(4, 1, 1, 0)
    assert noted(1, 2, 5, 4, 4, 5, 1).metrics() == ArrivalCounts(7, 1, 1, 3)


@pytest.mark.parametrize("lease", [0, 1])
def test_the_first_of_all_begins_the_count_whatever_its_lease(lease: int) -> None:
    assert noted(500, 501, lease=lease).metrics() == ArrivalCounts(2, 0, 0, 0)


def test_a_new_lease_begins_anew() -> None:
    arrivals = noted(100, 101)
    for sequence in (3, 4, 6):
        arrivals.note(8, sequence)
    assert (arrivals.lost, arrivals.late) == (1, 0)


def test_what_comes_after_its_number_is_forgotten_is_no_longer_late() -> None:
    newest = REMEMBERED + 2
    assert noted(0, newest, 2).metrics().late == 1
    assert noted(0, newest, 1).metrics() == ArrivalCounts(3, newest - 1, 0, 1)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=120))
def test_it_agrees_with_an_account_of_every_number(sequences: list[int]) -> None:
    seen, late, repeated, newest = {sequences[0]}, 0, 0, sequences[0]
    for sequence in sequences[1:]:
        if sequence in seen or sequence < sequences[0]:
            repeated += 1
        elif sequence < newest:
            late += 1
        seen.add(sequence)
        newest = max(newest, sequence)
    lost = len(set(range(sequences[0], newest)) - seen)
    expected = ArrivalCounts(len(sequences), lost, late, repeated)
    assert noted(*sequences).metrics() == expected
