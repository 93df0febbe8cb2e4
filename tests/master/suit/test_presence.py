from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from master.suit.presence import NodePresence

YES, NO = np.array([True]), np.array([False])


def present(lost_after: int) -> NodePresence:
    """One node that has just answered."""
    presence = NodePresence(1, lost_after)
    presence.close(YES, YES)
    assert not presence.lost[0]
    return presence


def test_a_node_that_never_answered_is_lost_but_never_left_sight() -> None:
    presence = NodePresence(2, 3)
    assert presence.lost.all()
    assert presence.awaited.all()
    assert presence.times_lost.tolist() == [0, 0]


@pytest.mark.parametrize("lost_after", [1, 2, 20])
def test_it_is_lost_at_exactly_lost_after_misses(lost_after: int) -> None:
    presence = present(lost_after)
    for _ in range(lost_after - 1):
        presence.close(NO, NO)
        assert not presence.lost[0]
        assert presence.awaited[0]
    presence.close(NO, NO)
    assert presence.lost[0]
    assert not presence.awaited[0]
    assert presence.times_lost[0] == 1


def test_one_answer_brings_it_back_and_the_count_starts_again() -> None:
    presence = present(2)
    presence.close(NO, NO)
    presence.close(YES, YES)
    presence.close(NO, NO)
    assert not presence.lost[0]
    presence.close(NO, NO)
    assert presence.lost[0]
    presence.close(YES, YES)
    assert not presence.lost[0]
    assert presence.awaited[0]
    assert presence.times_lost[0] == 1


def test_a_lost_node_that_is_heard_is_awaited_once_and_then_left_alone() -> None:
    """One that always answers too late is heard every window; it may hold up one in `lost_after`."""
    lost_after = 4
    presence = present(lost_after)
    waits = []
    for _ in range(40):
        presence.close(NO, YES)
        if presence.lost[0]:
            waits.append(bool(presence.awaited[0]))
    assert any(waits)
    first = waits.index(True)
    gaps = np.diff(np.flatnonzero(waits[first:]))
    assert gaps.min() > lost_after


def test_a_lost_bus_takes_its_nodes_at_once() -> None:
    presence = NodePresence(2, 5)
    presence.close(np.ones(2, bool), np.ones(2, bool))
    presence.lose(np.array([True, False]))
    assert presence.lost.tolist() == [True, False]
    assert presence.awaited.tolist() == [False, True]
    presence.close(np.array([False, True]), np.array([False, True]))
    assert presence.lost.tolist() == [True, False]
    assert presence.times_lost.tolist() == [1, 0]


def test_a_bus_that_is_back_at_once_brings_its_nodes_back() -> None:
    presence, all_there = NodePresence(2, 5), np.ones(2, bool)
    presence.close(all_there, all_there)
    presence.lose(all_there)
    presence.close(all_there, all_there)
    assert not presence.lost.any()
    assert presence.awaited.all()


def test_lost_after_must_be_a_count() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        NodePresence(1, 0)


@given(
    answers=st.lists(st.lists(st.booleans(), min_size=3, max_size=3), max_size=60),
    lost_after=st.integers(1, 5),
)
def test_lost_is_a_run_of_misses(answers: list[list[bool]], lost_after: int) -> None:
    presence = NodePresence(3, lost_after)
    for upto in range(1, len(answers) + 1):
        fresh = np.array(answers[upto - 1])
        presence.close(fresh, fresh)
        for node in range(3):
            history = [row[node] for row in answers[:upto]]
            runs = list(reversed(history))
            missed = runs.index(True) if True in runs else lost_after
            assert presence.lost[node] == (missed >= lost_after)
            assert presence.awaited[node] or presence.lost[node]
