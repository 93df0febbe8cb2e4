"""Work spread over processes: all of it comes back, and an error or an end leaves nobody behind."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable

import pytest

from common.errors import TandemError
from deploy.harness.workers import run_each


def square(item: int, tell: Callable[[int], object]) -> int:
    tell(item)
    if item < 0:
        raise TandemError(f"{item} has no root")
    return item * item


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_comes_back_and_all_is_told(jobs: int) -> None:
    heard: list[int] = []
    assert dict(run_each(square, [1, 2, 3], jobs, heard.append)) == {1: 1, 2: 4, 3: 9}
    assert sum(heard) == 6
    assert multiprocessing.active_children() == []


def test_an_error_passes_through_and_ends_the_rest() -> None:
    with pytest.raises(TandemError, match="-1 has no root"):
        list(run_each(square, [-1, *range(50)], 2))
    assert multiprocessing.active_children() == []


def test_who_stops_listening_ends_the_rest() -> None:
    running = run_each(square, range(50), 2)
    next(running)
    running.close()  # type: ignore[attr-defined]  # a generator
    assert multiprocessing.active_children() == []
