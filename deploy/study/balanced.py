"""The order in which conditions come, balanced over subjects and repeats. Pure."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import TypeVar

_One = TypeVar("_One")


def balanced_order(conditions: Sequence[_One], row: int, seed: int | str) -> list[_One]:
    """The conditions in the order of one row (0, 1, 2 …) of a Latin square by Williams (1949).

    Over n rows each of n conditions stands in each place once. Over n rows for even n, 2 n for odd n, each
    follows each other equally often, so that what one leaves behind in a person falls on all alike. The
    `seed` chooses which condition stands for which letter of the square.
    """
    drawn = list(conditions)
    random.Random(seed).shuffle(drawn)
    count = len(drawn)
    # 0, 1, n-1, 2, n-2 …: all differences of neighbours are different
    first = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(count)]
    order = [drawn[(letter + row) % count] for letter in first]
    mirrored = count % 2 == 1 and (row // count) % 2 == 1
    return order[::-1] if mirrored else order
