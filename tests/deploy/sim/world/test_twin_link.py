"""Two paths of the virtual world: each message arrives once, by whichever path is first."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

from deploy.sim.network.profile import Profile, Way
from deploy.sim.world.injection import Traffic
from deploy.sim.world.twin_link import DEAD, TwinLink

FAST, SLOW = Profile(both=Way(delay_ms=5.0)), Profile(both=Way(delay_ms=30.0))


class Clock:
    def __init__(self) -> None:
        self.now_ns = 0
        self._due: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()

    def at(self, when_ns: int, event: Callable[[], None]) -> None:
        heapq.heappush(self._due, (when_ns, next(self._order), event))

    def run_until(self, end_ns: int) -> None:
        while self._due and self._due[0][0] <= end_ns:
            self.now_ns, _, event = heapq.heappop(self._due)
            event()
        self.now_ns = end_ns


def arrivals(second: Profile | None, cut: range) -> tuple[list[tuple[int, float]], TwinLink]:
    """Number and age in ms of what arrived of 30 messages, one each 10 ms; `cut`: of the first path."""
    clock = Clock()
    link = TwinLink(FAST, second, 1, clock.at)
    came: list[tuple[int, float]] = []
    for number in range(30):
        sent_ns = number * 10_000_000
        clock.run_until(sent_ns)
        link.set(DEAD if number in cut else FAST, sent_ns)

        def arrive(number: int = number, sent_ns: int = sent_ns) -> None:
            came.append((number, (clock.now_ns - sent_ns) / 1e6))

        link.send(Traffic.COMMAND, sent_ns, 400, arrive)
    clock.run_until(10**9)
    return came, link


def test_each_arrives_once_and_by_the_faster_path() -> None:
    came, link = arrivals(SLOW, range(0))
    assert [number for number, _ in came] == list(range(30))
    assert all(age < 6.0 for _, age in came)
    assert link.duplicates == 30
    assert link.sent_bytes == 2 * 30 * 400


def test_while_the_first_is_cut_the_second_carries_and_none_comes_out_of_turn() -> None:
    came, _ = arrivals(SLOW, range(10, 20))
    numbers = [number for number, _ in came]
    assert numbers == sorted(set(numbers))
    # one that the first path's next overtakes is of no use any more
    assert {*range(10, 17)} <= set(numbers)


def test_one_path_alone_loses_what_is_cut() -> None:
    came, link = arrivals(None, range(10, 20))
    assert [number for number, _ in came] == [*range(10), *range(20, 30)]
    assert link.duplicates == 0
