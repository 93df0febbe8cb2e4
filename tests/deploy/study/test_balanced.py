"""A balanced order: places and neighbours are counted."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest

from deploy.study.balanced import balanced_order


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 7])
def test_each_stands_in_each_place_and_follows_each_other_equally_often(count: int) -> None:
    rows = count if count % 2 == 0 else 2 * count
    orders = [balanced_order("ABCDEFG"[:count], row, "study") for row in range(rows)]
    assert all(sorted(order) == sorted("ABCDEFG"[:count]) for order in orders)
    places = Counter((place, one) for order in orders for place, one in enumerate(order))
    assert set(places.values()) == {rows // count}
    assert len(places) == count * count
    follows = Counter(pair for order in orders for pair in pairwise(order))
    assert len(follows) == count * (count - 1)
    assert len(set(follows.values())) == 1


def test_the_seed_chooses_the_letters_and_the_rows_come_again() -> None:
    assert balanced_order("ABCD", 1, 5) == balanced_order("ABCD", 5, 5)
    assert len({tuple(balanced_order("ABCD", 0, seed)) for seed in range(20)}) > 3
