"""The packet scheduler on a virtual clock: nothing vanishes uncounted, order, rate, queue, delays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deploy.sim.network.profile import Way
from deploy.sim.network.scheduler import LOSS, OUTAGE, QUEUE, SIZE, PacketScheduler

MS = 1_000_000
FOR_EVER_NS = 10**15

WAYS = st.builds(
    Way,
    delay_ms=st.floats(20, 100),
    jitter_ms=st.floats(0, 20),
    loss_percent=st.floats(0, 50),
    burst_packets=st.none() | st.floats(1, 20),
    reorder_percent=st.sampled_from([0.0, 5.0]),
    duplicate_percent=st.sampled_from([0.0, 5.0]),
    rate_mbit=st.none() | st.floats(0.1, 100),
    queue_ms=st.floats(1, 500),
)
PACKETS = st.lists(st.tuples(st.integers(0, 20 * MS), st.integers(28, 1500)), min_size=1, max_size=200)
"""Time since the one before, and size."""


@dataclass
class Carried:
    scheduler: PacketScheduler[int]
    pushed_ns: dict[int, int]
    sizes: dict[int, int]
    arrivals: list[tuple[int, int]]
    """Time and number."""


def carry(way: Way, packets: list[tuple[int, int]], seed: int = 1) -> Carried:
    """Push the packets at their times; ask for each when it is due."""
    scheduler: PacketScheduler[int] = PacketScheduler(way, seed)
    carried = Carried(scheduler, {}, {}, [])
    now_ns = 0

    def ask(until_ns: int) -> None:
        while scheduler.next_ns is not None and scheduler.next_ns <= until_ns:
            at_ns = scheduler.next_ns
            carried.arrivals += [(at_ns, number) for number in scheduler.due(at_ns)]

    for number, (gap_ns, size) in enumerate(packets):
        now_ns += gap_ns
        ask(now_ns)
        carried.pushed_ns[number], carried.sizes[number] = now_ns, size
        scheduler.push(now_ns, number, size)
    ask(FOR_EVER_NS)
    return carried


def steady(way: Way, count: int, gap_ms: float = 5.0, size: int = 128, seed: int = 1) -> Carried:
    return carry(way, [(round(gap_ms * MS), size)] * count, seed)


def delays_ms(carried: Carried) -> np.ndarray:
    return np.array([at_ns - carried.pushed_ns[number] for at_ns, number in carried.arrivals]) / MS


@given(WAYS, PACKETS, st.integers(0, 100))
def test_every_packet_arrives_or_is_counted(way: Way, packets: list[tuple[int, int]], seed: int) -> None:
    carried = carry(way, packets, seed)
    counted = carried.scheduler.counters
    assert counted.packets == len(packets)
    assert counted.bytes == sum(size for _, size in packets)
    assert counted.delivered == len(carried.arrivals)
    assert counted.delivered_bytes == sum(carried.sizes[number] for _, number in carried.arrivals)
    assert counted.packets + counted.duplicated == counted.delivered + sum(counted.dropped.values())
    assert counted.dropped[OUTAGE] == 0
    assert carried.scheduler.next_ns is None


@given(WAYS, PACKETS, st.integers(0, 100))
def test_packets_keep_their_order_unless_they_shall_not(
    way: Way, packets: list[tuple[int, int]], seed: int
) -> None:
    numbers = [number for _, number in carry(way, packets, seed).arrivals]
    if not way.reorder_percent:
        assert numbers == sorted(numbers)
    if not way.duplicate_percent:
        assert len(set(numbers)) == len(numbers)


@given(WAYS, PACKETS, st.integers(0, 100))
def test_none_is_faster_than_the_link(way: Way, packets: list[tuple[int, int]], seed: int) -> None:
    carried = carry(way, packets, seed)
    floor_ms = max(way.delay_ms - 2.0 * way.jitter_ms, 0.0)
    for at_ns, number in carried.arrivals:
        own_ms = 0.0 if way.rate_mbit is None else carried.sizes[number] * 8e-3 / way.rate_mbit
        assert (at_ns - carried.pushed_ns[number]) / MS >= floor_ms + own_ms - 1e-3


@given(st.floats(0.1, 100), st.floats(1, 500), PACKETS)
def test_the_rate_is_never_exceeded_and_the_queue_is_bounded(
    rate_mbit: float, queue_ms: float, packets: list[tuple[int, int]]
) -> None:
    way = Way(rate_mbit=rate_mbit, queue_ms=queue_ms)
    carried = carry(way, packets)
    times = [at_ns for at_ns, _ in carried.arrivals]
    sizes = [carried.sizes[number] for _, number in carried.arrivals]
    for gap_ns, size in zip(np.diff(times), sizes[1:], strict=True):
        assert gap_ns >= size * 8e3 / rate_mbit - 1.0
    waited_ms = delays_ms(carried)
    assert (waited_ms <= way.queue_bytes * 8e-3 / rate_mbit + 1e-3).all()
    if carried.scheduler.counters.dropped[QUEUE]:
        # only a queue in which the packet has no room refuses it
        assert waited_ms.max() * rate_mbit / 8e-3 > way.queue_bytes - 2 * 1500


def test_a_full_queue_drops_the_newest_and_keeps_its_rate() -> None:
    way = Way(rate_mbit=1.0, queue_ms=120.0)  # ten packets of 1500 bytes
    carried = carry(way, [(0, 1500)] * 30)
    assert [number for _, number in carried.arrivals] == list(range(10))
    assert carried.scheduler.counters.dropped[QUEUE] == 20
    assert carried.arrivals[-1][0] == 120 * MS


@pytest.mark.parametrize(("mean_ms", "jitter_ms"), [(30.0, 10.0), (3.0, 2.0), (80.0, 3.0), (310.0, 15.0)])
@pytest.mark.parametrize("gap_ms", [5.0, 80.0])
def test_the_delay_has_the_profile_s_mean_and_spread_at_any_rate(
    mean_ms: float, jitter_ms: float, gap_ms: float
) -> None:
    # ten minutes and more: the mean of a process with memory settles slowly
    delay = delays_ms(
        steady(Way(delay_ms=mean_ms, jitter_ms=jitter_ms), 120_000 if gap_ms < 10 else 15_000, gap_ms)
    )
    assert delay.mean() == pytest.approx(mean_ms, abs=0.08 * jitter_ms)
    assert delay.std() == pytest.approx(jitter_ms, rel=0.15)
    assert np.percentile(delay, 50) < delay.mean()  # a tail towards late


def test_two_links_of_one_seed_are_late_at_the_same_times() -> None:
    way = Way(delay_ms=30.0, jitter_ms=10.0)
    often, seldom = steady(way, 4000, 5.0), steady(way, 250, 80.0)
    late = dict(zip((number * 5 for _, number in often.arrivals), delays_ms(often), strict=True))
    same = [late[80 * number + 75] for _, number in seldom.arrivals]
    assert np.corrcoef(delays_ms(seldom), same)[0, 1] > 0.99
    assert np.corrcoef(delays_ms(steady(way, 250, 80.0, seed=2)), same)[0, 1] < 0.5


def test_duplicates_follow_at_once_and_held_back_packets_are_passed() -> None:
    carried = steady(Way(delay_ms=10.0, reorder_percent=5.0, reorder_ms=12.0, duplicate_percent=5.0), 20_000)
    counted = carried.scheduler.counters
    assert counted.duplicated / 20_000 == pytest.approx(0.05, abs=0.005)
    assert counted.reordered / 20_000 == pytest.approx(0.05, abs=0.005)
    numbers = np.array([number for _, number in carried.arrivals])
    behind = numbers < np.maximum.accumulate(numbers)
    assert behind.sum() >= 0.94 * counted.reordered  # two in a row do not pass each other
    assert set(np.round(delays_ms(carried), 3)) == {10.0, 22.0}


def test_nothing_passes_while_it_is_cut() -> None:
    scheduler: PacketScheduler[str] = PacketScheduler(Way(delay_ms=30.0))
    scheduler.push(0, "under way", 100)
    scheduler.cut = True
    scheduler.push(10 * MS, "sent into the cut", 100)
    assert scheduler.due(30 * MS) == []
    scheduler.push(40 * MS, "and again", 100)
    scheduler.cut = False
    scheduler.push(50 * MS, "after it", 100)
    assert scheduler.due(1000 * MS) == ["after it"]
    assert scheduler.counters.dropped == {LOSS: 0, QUEUE: 0, SIZE: 0, OUTAGE: 3}


@settings(max_examples=20)
@given(WAYS, WAYS)
def test_a_profile_set_on_the_way_changes_nothing_that_is_under_way(before: Way, after: Way) -> None:
    # a queue that holds both: on a slow line the first still waits when the second comes
    sure = {"reorder_percent": 0.0, "loss_percent": 0.0, "duplicate_percent": 0.0, "queue_ms": 500.0}
    before, after = before.model_copy(update=sure), after.model_copy(update=sure)
    scheduler: PacketScheduler[int] = PacketScheduler(before)
    scheduler.push(0, 1, 500)
    due_ns = scheduler.next_ns
    scheduler.set(after, 10 * MS)
    assert scheduler.next_ns == due_ns
    scheduler.push(10 * MS, 2, 500)
    assert scheduler.due(FOR_EVER_NS) == [1, 2]
