"""What a window gives: values, units, what a node says of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from master.suit.nodes import NodeConfig
from master.suit.poll import Poll
from master.suit.protocol import NO_VALUE, NodeStatus

if TYPE_CHECKING:
    from tests.master.suit.conftest import Suit


def test_before_the_first_answer_there_is_nothing_to_use(new_suit: type[Suit], fd: bool) -> None:
    sweep = new_suit(fd).window([])
    assert sweep.lost.all()
    assert not sweep.fresh.any()
    assert np.isnan(sweep.mag_ut).all()
    assert not sweep.acc_m_s2.any()
    assert not sweep.gyr_rad_s.any()


def test_a_whole_window(suit: Suit) -> None:
    frames = suit.answers(1, seed=7)
    sweep = suit.window(frames)
    assert sweep.tick == 1
    assert sweep.sampled_ns == 5_000_000
    assert sweep.frames_in_ns == 5_000_000 + 1000 * len(frames)
    assert sweep.fresh.all()
    assert not sweep.lost.any()
    assert all(suit.holds(sweep, i, 7) for i in range(3))
    assert suit.complete == [False] * (len(frames) - 1) + [True]


@given(data=st.data())
def test_the_order_of_frames_does_not_matter(new_suit: type[Suit], fd: bool, data: st.DataObject) -> None:
    suit = new_suit(fd, count=5)
    frames = [f for n in suit.nodes for f in suit.answer(n.id, 1, seed=n.id)]
    sweep = suit.window(data.draw(st.permutations(frames)))
    assert sweep.fresh.all()
    assert all(new_suit.holds(sweep, i, i + 1) for i in range(5))
    assert suit.complete == [False] * (len(frames) - 1) + [True]


def test_fd_and_classic_buses_side_by_side_do_not_mix(new_suit: type[Suit]) -> None:
    nodes = [NodeConfig(id=1, bus="slow"), NodeConfig(id=1, bus="fast"), NodeConfig(id=2, bus="slow")]
    poll = Poll(nodes, new_suit.protocol, new_suit.lost_after, {"fast": True, "slow": False, "spare": True})
    for spoilt in (False, True):
        poll.open_window(9, 0)
        done = False
        for index, node in enumerate(nodes):
            counts = new_suit.raw(index)
            for frame in new_suit.protocol.encode_sample(node.id, counts, 9, 0, node.bus == "fast"):
                done = poll.on_frame(node.bus, frame.id, frame.data, 0)
        assert done
        if spoilt:  # an answer on the wrong bus is of no node there
            frame = new_suit.protocol.encode_sample(1, new_suit.raw(8), 9, 0, True)[0]
            poll.on_frame("spare", frame.id, frame.data, 0)
        sweep = poll.close_window(1)
        assert sweep.fresh.all()
        assert all(new_suit.holds(sweep, index, index) for index in range(3))
    assert poll.bus_health["spare"].unknown_id == 1


@pytest.mark.parametrize("axis", [6, 7, 8])
def test_one_reserved_axis_means_no_magnetic_reading(suit: Suit, fd: bool, axis: int) -> None:
    suit.settle()
    counts = suit.raw(3)
    counts[axis] = NO_VALUE
    blank = suit.protocol.encode_sample(1, counts, 2, 0, fd)
    sweep = suit.window([*blank, *suit.answers(2, seed=3, without=(1,))])
    assert sweep.fresh.all()
    assert np.isnan(sweep.mag_ut[0]).all()
    assert np.isfinite(sweep.mag_ut[1:]).all()
    assert sweep.acc_m_s2[0].tolist() == sweep.acc_m_s2[1].tolist()
    assert suit.holds(suit.window(suit.answers(3, seed=4)), 0, 4)


@pytest.mark.parametrize("value", [NO_VALUE + 1, 32767])
def test_the_counts_beside_the_reserved_one_are_readings(new_suit: type[Suit], value: int) -> None:
    suit = new_suit(fd=True, count=1)
    sweep = suit.window(new_suit.protocol.encode_sample(1, np.full(9, value, np.int16), 1, 0, True))
    assert sweep.mag_ut[0].tolist() == [value * new_suit.protocol.mag_scale] * 3


def test_the_reserved_count_is_a_reading_of_the_other_sensors(new_suit: type[Suit], fd: bool) -> None:
    suit = new_suit(fd, count=1)
    counts = np.array([NO_VALUE] * 6 + [1, 2, 3], np.int16)
    sweep = suit.window(new_suit.protocol.encode_sample(1, counts, 1, 0, fd))
    assert sweep.acc_m_s2[0].tolist() == [NO_VALUE * new_suit.protocol.acc_scale] * 3
    assert sweep.gyr_rad_s[0].tolist() == [NO_VALUE * new_suit.protocol.gyr_scale] * 3
    assert np.isfinite(sweep.mag_ut).all()


def test_a_node_without_magnetometer_has_none_whatever_it_sends(new_suit: type[Suit], fd: bool) -> None:
    suit = new_suit(fd, magnetometer=False)
    sweep = suit.window(suit.answers(1, seed=3))
    assert sweep.fresh.all()
    assert np.isnan(sweep.mag_ut).all()


def test_a_saturated_reading_is_used_and_counted(suit: Suit, fd: bool) -> None:
    suit.settle()
    sweep = suit.window(
        [*suit.answer(1, 2, seed=9, status=NodeStatus.SATURATED), *suit.answers(2, without=(1,))]
    )
    assert sweep.fresh.all()
    assert suit.holds(sweep, 0, 9)
    assert suit.health(1).saturated == 1
    assert suit.health(2).saturated == 0


def test_one_faulty_part_of_a_classic_answer_condemns_it(new_suit: type[Suit]) -> None:
    suit = new_suit(fd=False)
    suit.settle()
    parts = suit.answer(1, 2, seed=9)
    parts[1] = suit.answer(1, 2, seed=9, status=NodeStatus.FAULT)[1]
    sweep = suit.window([*parts, *suit.answers(2, without=(1,))])
    assert not sweep.fresh[0]
    assert new_suit.holds(sweep, 0, 0)


def test_a_sweep_keeps_its_values_when_the_next_one_comes(suit: Suit) -> None:
    sweeps = [suit.window(suit.answers(1, seed=1)), suit.window(suit.answers(2, seed=2, without=(2,)))]
    kept = [(s.acc_m_s2.copy(), s.mag_ut.copy(), s.fresh.copy(), s.lost.copy()) for s in sweeps]
    suit.window(suit.answers(3, seed=3, without=(1,)))
    suit.window(suit.answers(4, seed=4))
    for sweep, before in zip(sweeps, kept, strict=True):
        after = (sweep.acc_m_s2, sweep.mag_ut, sweep.fresh, sweep.lost)
        assert all((a == b).all() for a, b in zip(after, before, strict=True))
