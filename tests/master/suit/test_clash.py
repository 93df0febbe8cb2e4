"""Two nodes of one id, two suits, two masters: named; what a bus repeats by itself is not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from common.can.frame import CanFrame
from master.suit.clash import CLEAR, NOTICED, TWICE_IN_A_ROW, WITHIN
from master.suit.number import number_of

if TYPE_CHECKING:
    from tests.master.suit.conftest import Suit

IN_HALF_A_SECOND = 100


def windows_until_named(suit: Suit, frames: object, most: int = IN_HALF_A_SECOND) -> int | None:
    for count in range(1, most + 1):
        suit.window(frames(suit.tick + 1))  # type: ignore[operator]
        if suit.poll.clashes.doubted.any():
            return count
    return None


def test_two_answers_that_differ_are_two_nodes(suit: Suit) -> None:
    suit.settle()
    count = windows_until_named(
        suit, lambda tick: [*suit.answers(tick, seed=1), *suit.answer(1, tick, seed=tick % 50 + 2)]
    )
    assert count == NOTICED
    assert suit.poll.clashes.doubted.tolist() == [True, False, False]
    assert "two nodes answer with its id" in suit.poll.clashes.doubts()[0].words


def test_a_second_suit_whose_answers_come_after_the_window_closed(suit: Suit) -> None:
    """The first three answers close it; the others are found in the next window, with the last tick."""
    suit.settle()

    def frames(tick: int) -> list[CanFrame]:
        late = suit.answers(tick - 1, seed=(tick - 1) % 50 + 60)
        return [*late, *suit.answers(tick, seed=tick % 50)]

    assert windows_until_named(suit, frames) == NOTICED
    assert suit.poll.clashes.doubted.all()


def test_a_frame_that_the_bus_repeats_is_no_second_node(suit: Suit) -> None:
    suit.settle()

    def frames(tick: int) -> list[CanFrame]:
        mine = suit.answers(tick, seed=tick % 50)
        again = [] if tick % 10 else mine
        late = [] if tick % 7 else suit.answers(tick - 1, seed=(tick - 1) % 50)
        return [*late, *mine, *again]

    assert windows_until_named(suit, frames, most=400) is None


def test_twice_the_rate_is_a_second_node_even_if_it_says_the_same(suit: Suit) -> None:
    suit.settle()
    count = windows_until_named(suit, lambda tick: 2 * suit.answers(tick, seed=tick % 50))
    assert count == TWICE_IN_A_ROW <= IN_HALF_A_SECOND


def test_a_late_answer_is_no_second_node(suit: Suit) -> None:
    suit.settle()

    def frames(tick: int) -> list[CanFrame]:
        late = suit.answer(1, tick - 1, seed=(tick - 1) % 50)
        return [*late, *suit.answers(tick, seed=tick % 50, without=(1,))]

    assert windows_until_named(suit, frames, most=200) is None


def test_seldom_differences_are_not_named(suit: Suit) -> None:
    suit.settle()

    def frames(tick: int) -> list[CanFrame]:
        more = [] if tick % WITHIN else suit.answer(1, tick, seed=3)
        return [*suit.answers(tick, seed=tick % 50 + 4), *more]

    assert windows_until_named(suit, frames, most=1000) is None


def test_it_is_believed_again_after_a_while_without(suit: Suit) -> None:
    suit.settle()
    assert windows_until_named(suit, lambda tick: [*suit.answers(tick, 1), *suit.answer(1, tick, 2)])
    for _ in range(CLEAR - 1):
        suit.window(suit.answers(suit.tick + 1))
        assert suit.poll.clashes.doubted.any()
    suit.window(suit.answers(suit.tick + 1))
    assert not suit.poll.clashes.doubts()


@pytest.mark.parametrize("number", [3, 10**6])
def test_another_masters_sync_is_named(suit: Suit, number: int) -> None:
    suit.settle()
    count = windows_until_named(
        suit, lambda tick: [suit.protocol.sync(number + number_of(tick)), *suit.answers(tick, tick % 50)]
    )
    assert count == NOTICED
    assert suit.poll.clashes.doubted.all()
    assert "another master sends SYNC" in suit.poll.clashes.doubts()[2].words
    assert suit.poll.bus_health["arm"].foreign_sync == NOTICED
