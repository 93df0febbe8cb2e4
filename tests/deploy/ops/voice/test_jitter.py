"""The order of a voice's packets on a virtual clock: links that delay, jitter, lose, double and pause."""

from __future__ import annotations

import random
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from common.clock import NS_PER_MS
from common.wire.voice import VoicePacket
from deploy.ops.voice.jitter import FRAME_NS, LEAST_FRAMES, MOST_FRAMES, JitterBuffer

Arrivals = list[tuple[int, int]]
"""(ns, sequence)"""


def arrivals(count: int, jitter_ms: float, loss: float = 0.0, seed: int = 1) -> Arrivals:
    rng = random.Random(seed)
    sent = [(i * FRAME_NS + round(NS_PER_MS * (40 + rng.uniform(0, jitter_ms))), i) for i in range(count)]
    return sorted(each for each in sent if rng.random() >= loss)


def played(came: Arrivals, until_ns: int, buffer: JitterBuffer) -> list[tuple[int, int | None]]:
    """(ns, sequence that was played or None) every 20 ms."""
    out: list[tuple[int, int | None]] = []
    waiting = list(came)
    for now_ns in range(0, until_ns, FRAME_NS):
        while waiting and waiting[0][0] <= now_ns:
            arrived_ns, sequence = waiting.pop(0)
            buffer.put(VoicePacket(1, sequence, False, str(sequence).encode()), arrived_ns)
        body = buffer.take()
        out.append((now_ns, None if body is None else int(body)))
    return out


def latency_ms(heard: list[tuple[int, int | None]]) -> list[float]:
    return [(at_ns - one * FRAME_NS) / NS_PER_MS for at_ns, one in heard if one is not None]


def test_a_good_link_is_heard_whole_and_soon() -> None:
    buffer = JitterBuffer()
    heard = played(arrivals(500, 0.0), 500 * FRAME_NS, buffer)
    words = [one for _, one in heard if one is not None]
    assert words == list(range(len(words)))
    assert len(words) > 490
    assert max(latency_ms(heard)) <= 40 + 20 * LEAST_FRAMES + 20


def test_jitter_makes_it_deeper_and_calm_makes_it_shallow_again() -> None:
    buffer = JitterBuffer()
    rough = arrivals(500, 120.0)
    calm = [(at + 500 * FRAME_NS, i + 500) for at, i in arrivals(1000, 2.0)]
    heard = played(sorted(rough + calm), 1500 * FRAME_NS, buffer)
    late = latency_ms(heard)
    assert max(late) <= 40 + 20 * (MOST_FRAMES + 3)
    assert max(late[-100:]) <= 40 + 20 * (LEAST_FRAMES + 3)
    assert buffer.counters.late < 25


def test_lost_ones_are_missing_and_counted_and_the_order_holds() -> None:
    buffer = JitterBuffer()
    came = arrivals(1000, 10.0, loss=0.1)
    heard = played(came, 1000 * FRAME_NS, buffer)
    words = [one for _, one in heard if one is not None]
    assert all(a < b for a, b in pairwise(words))
    lost = 1000 - len(came)
    assert abs(buffer.counters.missing - lost) < 20
    assert len(words) > 0.97 * len(came)


def test_after_a_pause_of_the_link_old_words_are_dropped_not_played_late() -> None:
    """Packets of 3 s arrive together, as after an outage."""
    buffer = JitterBuffer()
    came = [(max(at, 250 * FRAME_NS), i) if 100 <= i < 250 else (at, i) for at, i in arrivals(600, 0.0)]
    heard = played(sorted(came), 600 * FRAME_NS, buffer)
    after = [(at, one) for at, one in heard if at >= 252 * FRAME_NS]
    assert max(latency_ms(after)) <= 40 + 20 * (MOST_FRAMES + 8)
    assert max(latency_ms(after)[-50:]) <= 40 + 20 * (MOST_FRAMES + 3)
    assert buffer.counters.stale + buffer.counters.late > 130


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3_000), st.integers(0, 120)), max_size=150))
def test_whatever_comes_nothing_is_played_twice_or_out_of_order_and_little_waits(
    came: list[tuple[int, int]],
) -> None:
    buffer = JitterBuffer()
    heard: list[list[int]] = []
    waiting = sorted((at_ms * NS_PER_MS, sequence) for at_ms, sequence in came)
    for now_ns in range(0, 4_000 * NS_PER_MS, FRAME_NS):
        while waiting and waiting[0][0] <= now_ns:
            arrived_ns, sequence = waiting.pop(0)
            buffer.put(VoicePacket(1, sequence, False, str(sequence).encode()), arrived_ns)
        assert buffer.waiting <= MOST_FRAMES + 8
        speaking = buffer.speaking
        body = buffer.take()
        if not speaking:
            heard.append([])
        elif body is not None:
            heard[-1:] = [[*(heard[-1] if heard else []), int(body)]]
    for run in heard:
        assert all(a < b for a, b in pairwise(run))
    counted = buffer.counters
    assert counted.received == len(came)
    assert counted.played + counted.late + counted.stale <= counted.received


def test_another_stream_begins_anew() -> None:
    buffer = JitterBuffer()
    played(arrivals(50, 0.0), 60 * FRAME_NS, buffer)
    for sequence in range(3):
        buffer.put(VoicePacket(2, sequence, False, b"new"), (70 + sequence) * FRAME_NS)
    assert [buffer.take() for _ in range(3)] == [b"new"] * 3
