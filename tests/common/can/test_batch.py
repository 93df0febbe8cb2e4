"""Frames that wait at a socket, read in batches: over UDP, whose datagrams the kernel stamps likewise."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import pytest

from common.can import batch
from common.clock import monotonic_ns

pytestmark = pytest.mark.skipif(not batch.can_batch("socketcan"), reason="no recvmmsg on this system")
FRAME = struct.Struct("=IB3x8s")

Taken = list[tuple[int, bytes, int]]


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    near, far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with near, far:
        near.bind(("127.0.0.1", 0))
        far.connect(near.getsockname())
        yield near, far


def send(far: socket.socket, numbers: range) -> None:
    for number in numbers:
        far.send(FRAME.pack(number, 8, number.to_bytes(8, "big")))


def test_what_waits_is_read_in_one_go_also_where_it_is_more_than_a_call_takes(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    near, far = ends
    taken: Taken = []
    reader = batch.BatchReader(near.fileno(), taken.extend, lambda _: False)
    began_ns = monotonic_ns()
    send(far, range(2 * batch.AT_ONCE + 5))
    reader.read()
    assert [frame_id for frame_id, _, _ in taken] == list(range(2 * batch.AT_ONCE + 5))
    times = [at_ns for *_, at_ns in taken]
    assert times == sorted(times)
    assert began_ns <= times[0] <= times[-1] <= monotonic_ns()


def test_a_bus_that_never_falls_silent_does_not_keep_the_loop(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "MOST_CALLS", 2)
    near, far = ends
    taken: Taken = []

    def take(frames: Taken) -> None:
        taken.extend(frames)
        send(far, range(len(frames)))

    reader = batch.BatchReader(near.fileno(), take, lambda _: False)
    send(far, range(batch.AT_ONCE))
    reader.read()
    assert len(taken) == 2 * batch.AT_ONCE


def test_a_reader_that_is_stopped_by_what_it_reads_reads_no_more(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    near, far = ends
    taken: Taken = []

    def take(frames: Taken) -> None:
        taken.extend(frames)
        reader.stop()

    reader = batch.BatchReader(near.fileno(), take, lambda _: False)
    send(far, range(batch.AT_ONCE + 1))
    reader.read()
    assert len(taken) == batch.AT_ONCE


def test_a_reading_of_the_clocks_that_was_interrupted_shifts_no_stamp(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [1000]
    took = iter([10, 5_000_000, 10, 10, 10, 10])

    def own_ns() -> int:
        now[0] += next(took)
        return now[0]

    def wall() -> int:
        return now[0] + 7_000_000_000

    monkeypatch.setattr(batch, "monotonic_ns", own_ns)
    monkeypatch.setattr(batch, "wall_ns", wall)
    assert batch._wall_minus_monotonic_ns() == pytest.approx(7_000_000_000, abs=20)
