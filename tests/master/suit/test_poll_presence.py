"""Who is late, lost and back, and for whom a window waits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from master.suit.nodes import NodeConfig
from master.suit.poll import Poll
from master.suit.protocol import NodeStatus

if TYPE_CHECKING:
    from tests.master.suit.conftest import Suit


def test_late_becomes_lost_at_lost_after_and_one_answer_restores_it(suit: Suit) -> None:
    suit.settle()
    for missed in range(1, suit.lost_after + 3):
        sweep = suit.window(suit.answers(suit.tick + 1, without=(2,)))
        assert sweep.lost.tolist() == [False, missed >= suit.lost_after, False]
        assert sweep.fresh.tolist() == [True, False, True]
        assert suit.holds(sweep, 1, 0)
        # awaited while late: the window runs out; lost: it ends with the last of the others
        assert any(suit.complete) == (missed > suit.lost_after)
    sweep = suit.window(suit.answers(suit.tick + 1, seed=2))
    assert sweep.fresh.all()
    assert not sweep.lost.any()
    assert suit.holds(sweep, 1, 2)
    health = suit.health(2)
    assert (health.fresh, health.late, health.lost, health.times_lost) == (2, suit.lost_after - 1, 3, 1)


def test_a_lost_node_that_answers_after_the_others_still_comes_back(suit: Suit) -> None:
    """The window no longer waits for it, so its answers fall behind the close, until one is noticed."""
    suit.settle()
    for _ in range(suit.lost_after):
        suit.window(suit.answers(suit.tick + 1, without=(3,)))
    for _ in range(3 * suit.lost_after):
        suit.open()
        others = suit.answers(suit.tick, without=(3,))
        mine = suit.answer(3, suit.tick, seed=1)
        complete = [suit.poll.on_frame("arm", f.id, f.data, 0) for f in others]
        if complete[-1]:  # the master closes at once, and the node's answer comes into the gap
            sweep = suit.poll.close_window(0)
            for frame in mine:
                suit.poll.on_frame("arm", frame.id, frame.data, 0)
        else:
            assert [suit.poll.on_frame("arm", f.id, f.data, 0) for f in mine][-1]
            sweep = suit.poll.close_window(0)
    assert sweep.fresh.all()
    assert suit.holds(sweep, 2, 1)


def test_when_all_are_lost_the_window_stays_open_for_all_to_come_back(suit: Suit) -> None:
    for _ in range(suit.lost_after + 2):
        suit.window([])
    sweep = suit.window(suit.answers(suit.tick + 1))
    assert not any(suit.complete)
    assert sweep.fresh.all()


def test_a_bus_that_fails_takes_its_nodes_at_once_and_only_them(fd: bool, new_suit: type[Suit]) -> None:
    nodes = [NodeConfig(id=1, bus="left"), NodeConfig(id=1, bus="right")]
    poll = Poll(nodes, new_suit.protocol, new_suit.lost_after, {"left": fd, "right": fd})

    def window(tick: int, *buses: str) -> list[bool]:
        poll.open_window(tick, 0)
        return [
            poll.on_frame(bus, f.id, f.data, 0)
            for bus in buses
            for f in new_suit.protocol.encode_sample(1, new_suit.raw(tick), tick, 0, fd)
        ]

    assert window(1, "left", "right")[-1]
    assert poll.close_window(0).fresh.all()
    window(2, "left")
    poll.bus_down("left")
    sweep = poll.close_window(0)
    assert sweep.lost.tolist() == [True, False]
    assert not sweep.fresh.any()
    assert new_suit.holds(sweep, 0, 1)
    assert window(3, "right")[-1]
    assert poll.close_window(0).lost.tolist() == [True, False]
    window(4, "left", "right")
    sweep = poll.close_window(0)
    assert not sweep.lost.any()
    assert new_suit.holds(sweep, 0, 4)
    assert poll.health[0].times_lost == 1


def test_a_faulty_sensor_changes_nothing_and_is_lost_in_time(suit: Suit) -> None:
    suit.settle()
    for missed in range(1, suit.lost_after + 1):
        tick = suit.tick + 1
        faulty = suit.answer(1, tick, seed=9, status=NodeStatus.FAULT)
        sweep = suit.window([*faulty, *suit.answers(tick, seed=5, without=(1,))])
        assert suit.complete[-1]
        assert sweep.fresh.tolist() == [False, True, True]
        assert sweep.lost.tolist() == [missed >= suit.lost_after, False, False]
        assert suit.holds(sweep, 0, 0)
    assert suit.health(1).faults == suit.lost_after


def test_the_summary_names_who_is_lost(new_suit: type[Suit]) -> None:
    suit = new_suit(fd=True)
    suit.settle()
    for _ in range(new_suit.lost_after):
        suit.window(suit.answers(suit.tick + 1, without=(2,)))
    summary = suit.poll.summary()
    assert summary["lost_now"] == ["arm 2"]
    assert summary["times_lost"] == 1
    assert summary["late"] == new_suit.lost_after - 1
    assert summary["unknown_id"] == 0
