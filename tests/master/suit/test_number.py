"""The number that a SYNC carries: it rises, is told back, and shows answers that are old by a whole wrap."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire.messages import Mask
from master.suit.nodes import NodeConfig
from master.suit.number import EPOCH, number_of, tick_of
from master.suit.poll import Poll
from master.suit.protocol import SuitProtocol

PROTOCOL = SuitProtocol.load()


@given(st.integers(0, 2**34))
def test_a_tick_is_told_back_and_numbers_rise(tick: int) -> None:
    assert tick_of(number_of(tick)) == tick
    assert 0 < number_of(tick + 1) - number_of(tick) <= EPOCH


def test_the_first_ticks_are_their_own_numbers() -> None:
    assert [number_of(tick) for tick in (0, 1, 63, 64)] == [0, 1, 63, 65]


def freshness(lag: int, ticks: int = 3000, lost_after: int = 20) -> list[Mask]:
    """A classic node that answers every SYNC, always so many ticks late."""
    poll = Poll([NodeConfig(id=1, bus="arm")], PROTOCOL, lost_after, {"arm": False})
    counts = np.arange(9, dtype=np.int16) + 1
    alive, numbers = [], []
    for tick in range(ticks):
        sync = poll.open_window(tick, tick * 5_000_000)
        numbers.append(PROTOCOL.parse_sync(sync.data))
        if tick >= lag:
            for frame in PROTOCOL.encode_sample(1, counts + tick % 7, numbers[tick - lag], 0, fd=False):
                poll.on_frame("arm", frame.id, frame.data, 0)
        alive.append(~poll.close_window(0).lost)
    return alive


@pytest.mark.parametrize("lag", [1, 64])
def test_answers_that_are_late_by_one_tick_or_by_a_wrap_never_count(lag: int) -> None:
    assert not any(alive[0] for alive in freshness(lag))


@pytest.mark.parametrize("lag", [2, 62, 63, 65, 96, 97, 127, 128, 192, 256, 640, 1024])
def test_no_lag_is_believed_for_a_second(lag: int) -> None:
    """A node must be there for one second (200 ticks) before its joints are valid."""
    longest = run = 0
    for alive in freshness(lag):
        run = run + 1 if alive[0] else 0
        longest = max(longest, run)
    assert longest < 200


def test_answers_in_time_always_count() -> None:
    assert all(alive[0] for alive in freshness(0))
