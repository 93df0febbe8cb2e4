"""No unsound frame ever changes a value, and each is counted where it belongs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.can.frame import CanFrame
from master.suit.crc import frame_crc
from master.suit.number import number_of

if TYPE_CHECKING:
    from tests.master.suit.conftest import Suit


def spoil_checksum(frame: CanFrame) -> CanFrame:
    return replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ 1]))


def spoil_reading(frame: CanFrame) -> CanFrame:
    return replace(frame, data=bytes([frame.data[0] ^ 0x80]) + frame.data[1:])


def wrong_number(frame: CanFrame) -> CanFrame:
    """Node 1's frame sent under node 2's identifier."""
    return replace(frame, id=frame.id + 1)


def shorter(frame: CanFrame) -> CanFrame:
    return replace(frame, data=frame.data[:-1])


def longer(frame: CanFrame) -> CanFrame:
    return replace(frame, data=frame.data + b"\0")


def empty(frame: CanFrame) -> CanFrame:
    return replace(frame, data=b"")


SPOILERS = [
    (spoil_checksum, 1, "bad_checksum"),
    (spoil_reading, 1, "bad_checksum"),
    (wrong_number, 2, "bad_checksum"),
    (shorter, 1, "bad_length"),
    (longer, 1, "bad_length"),
    (empty, 1, "bad_length"),
]


@pytest.mark.parametrize(("spoil", "blamed", "counter"), SPOILERS, ids=[s[0].__name__ for s in SPOILERS])
@pytest.mark.parametrize("part", [0, -1], ids=["first part", "last part"])
def test_an_unsound_frame_never_changes_a_value(
    suit: Suit, spoil: Callable[[CanFrame], CanFrame], blamed: int, counter: str, part: int
) -> None:
    suit.settle()
    mine = suit.answer(1, 2, seed=9)
    mine[part] = spoil(mine[part])
    sweep = suit.window([*mine, *suit.answers(2, seed=5, without=(1, blamed))])
    assert not sweep.fresh[0]
    assert suit.holds(sweep, 0, 0)
    assert suit.holds(sweep, blamed - 1, 0)
    assert suit.holds(sweep, 2, 5)
    assert getattr(suit.health(blamed), counter) == 1
    assert suit.health(1).late == 1
    totals = suit.poll.summary()
    assert [totals[c] for c in ("bad_checksum", "bad_tick", "bad_length")].count(1) == 1
    assert [totals[c] for c in ("bad_checksum", "bad_tick", "bad_length")].count(0) == 2


@pytest.mark.parametrize("offset", [-2, -1, 1, 2])
def test_an_answer_to_another_tick_never_changes_a_value(suit: Suit, offset: int) -> None:
    suit.settle()
    suit.settle()
    parts = suit.answer(1, suit.tick + 1 + offset, seed=9)
    sweep = suit.window([*parts, *suit.answers(suit.tick + 1, seed=5, without=(1,))])
    assert sweep.fresh.tolist() == [False, True, True]
    assert suit.holds(sweep, 0, 0)
    assert suit.health(1).bad_tick == len(parts)
    assert not any(suit.complete)
    assert sweep.frames_in_ns == 5_000_000 * suit.tick + 4_000_000


def test_a_late_answer_neither_counts_for_its_tick_nor_spoils_the_next(suit: Suit) -> None:
    """It arrives after the close; the next window finds it there, drops it and takes the right one."""
    suit.settle()
    suit.window(suit.answers(2, without=(1,)))
    for frame in suit.answer(1, 2, seed=8):
        suit.poll.on_frame("arm", frame.id, frame.data, 0)
    sweep = suit.window(suit.answers(3, seed=4))
    assert sweep.fresh.all()
    assert suit.holds(sweep, 0, 4)
    assert suit.health(1).bad_tick == len(suit.answer(1, 2))
    assert suit.health(1).late == 1


def test_the_tick_wraps_where_the_wire_does(suit: Suit) -> None:
    suit.tick = 2**32 - 2
    for _ in range(4):
        sweep = suit.window(suit.answers(suit.tick + 1))
        assert sweep.fresh.all()
        assert sweep.tick == suit.tick


def test_a_tick_is_told_apart_as_far_as_its_frame_carries_it(suit: Suit, fd: bool) -> None:
    span = 2**32 if fd else 64
    suit.tick = span - 1

    def shown(ahead: int) -> list[CanFrame]:
        number = number_of(suit.tick + 1) + ahead
        encode = suit.protocol.encode_sample
        return [f for n in suit.nodes for f in encode(n.id, suit.raw(0), number, 0, fd)]

    for wrong in (span // 2, 1, span - 1):
        assert not suit.window(shown(wrong)).fresh.any()
    assert suit.window(shown(span)).fresh.all()


def test_an_unknown_identifier_is_counted_for_the_bus(suit: Suit, fd: bool) -> None:
    suit.settle()
    good = suit.answers(2, seed=3)
    strangers = [
        *suit.answer(4, 2),
        CanFrame(0x080, b"1234", fd=False),
        CanFrame(0, b"", fd=False),
        CanFrame(0x7FF, bytes(8), fd=False),
        CanFrame(0x10105, bytes(24), fd=True),
        *suit.protocol.encode_sample(1, suit.raw(0), 2, 0, not fd),
    ]
    sweep = suit.window([*strangers, *good])
    assert sweep.fresh.all()
    assert suit.holds(sweep, 0, 3)
    # one of them bears SYNC's identifier
    assert suit.poll.bus_health["arm"].unknown_id == len(strangers) - 1
    assert suit.poll.bus_health["arm"].foreign_sync == 1
    assert suit.poll.health[0].fresh == 2


def test_of_duplicates_the_first_stands_and_the_others_are_counted(suit: Suit) -> None:
    suit.settle()
    first, again = suit.answer(1, 2, seed=6), suit.answer(1, 2, seed=7)
    sweep = suit.window([*first, *again, *suit.answers(2, without=(1,))])
    assert suit.holds(sweep, 0, 6)
    assert suit.health(1).duplicates == len(again)
    assert suit.health(2).duplicates == 0
    assert suit.health(1).fresh == 2


def test_a_sound_frame_after_an_unsound_one_counts(suit: Suit) -> None:
    suit.settle()
    good = suit.answer(1, 2, seed=6)
    sweep = suit.window([spoil_checksum(good[0]), *good, *suit.answers(2, without=(1,))])
    assert suit.holds(sweep, 0, 6)
    assert suit.health(1).duplicates == 0
    assert suit.health(1).bad_checksum == 1


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_a_classic_answer_needs_all_three_frames(new_suit: type[Suit], missing: int) -> None:
    suit = new_suit(fd=False)
    suit.settle()
    parts = suit.answer(1, 2, seed=6)
    del parts[missing]
    sweep = suit.window([*parts, *suit.answers(2, without=(1,))])
    assert not sweep.fresh[0]
    assert new_suit.holds(sweep, 0, 0)
    assert not any(suit.complete)


def test_a_babbling_bus_cannot_fill_the_memory(new_suit: type[Suit]) -> None:
    suit = new_suit(fd=True, count=2)
    room = 2 * 16
    stranger = CanFrame(0x7FF, bytes(8), fd=False)
    assert suit.window([stranger] * room).lost.all()
    assert suit.poll.bus_health["arm"].overflow == 0
    suit.window([stranger] * (room + 5))
    assert suit.poll.bus_health["arm"].overflow == 5
    assert suit.window(suit.answers(suit.tick + 1)).fresh.all()


@given(data=st.data())
def test_random_traffic_only_ever_yields_what_was_soundly_answered(
    new_suit: type[Suit], fd: bool, data: st.DataObject
) -> None:
    """Against a plain model: a node has the first sound answer to this tick, or the value before."""
    suit = new_suit(fd)
    expected: list[int | None] = [None, None, None]
    fates = st.sampled_from(["good", "good", "good", "absent", "spoilt", "stale", "short", "twice"])
    for _ in range(data.draw(st.integers(1, 8))):
        tick = suit.tick + 1
        frames: list[CanFrame] = []
        answered = []
        for node in suit.nodes:
            fate = data.draw(fates)
            seed = data.draw(st.integers(0, 50))
            parts = suit.answer(node.id, tick - (fate == "stale"), seed)
            if fate == "spoilt":
                parts[-1] = spoil_reading(parts[-1])
            elif fate == "short":
                parts[-1] = shorter(parts[-1])
            elif fate == "twice":
                parts += suit.answer(node.id, tick, seed + 1)
            if fate != "absent":
                frames += parts
            answered.append(fate in ("good", "twice"))
            if answered[-1]:
                expected[node.id - 1] = seed
        sweep = suit.window(frames)
        assert sweep.fresh.tolist() == answered
        for index, answer in enumerate(expected):
            if answer is None:
                assert sweep.lost[index]
            else:
                assert suit.holds(sweep, index, answer)
    for health in suit.poll.health:
        assert health.fresh + health.late + health.lost == suit.tick


def test_the_checksum_covers_the_number_of_the_node(new_suit: type[Suit]) -> None:
    """The frame of `wrong_number` fails by its identifier alone: under the right one it is sound."""
    frame = new_suit.protocol.encode_sample(1, new_suit.raw(0), 1, 0, True)[0]
    assert frame_crc(frame.id, frame.data[:-1]) == frame.data[-1] != frame_crc(frame.id + 1, frame.data[:-1])
