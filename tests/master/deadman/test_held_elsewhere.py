"""A deadman that is held on a page: fresh beats hold it, and nothing else does."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import pytest

from common.clock import to_ns
from common.errors import CodecError, TandemError
from common.inputs.heartbeat import DeadmanBeat, decode_beat, encode_beat
from master.deadman.config import ConsoleHold
from master.deadman.grip import Grip, OperatorGrip
from master.deadman.held_elsewhere import HeldElsewhere
from master.deadman.hold_socket import HoldSocket
from master.deadman.switches import Switches
from master.suit.protocol import SHIPPED_DBC

TIMEOUT_S = 0.3
MS = to_ns(0.001)


def beat(number: int, at_ns: int, down: bool = True) -> bytes:
    return encode_beat(DeadmanBeat(down, number, at_ns))


def held(*numbers_at: tuple[int, int]) -> HeldElsewhere:
    """After beats of these numbers at these times, in ms."""
    made = HeldElsewhere(TIMEOUT_S)
    for number, at_ms in numbers_at:
        made.datagram(beat(number, at_ms * MS), at_ms * MS)
    return made


def test_it_is_unknown_until_a_beat_comes() -> None:
    made = held()
    assert made.at(0) is None
    assert "no page" in made.words
    made.datagram(beat(1, 0, down=False), 0)
    assert (made.at(0), made.words) == (False, "")
    made.datagram(beat(2, MS), MS)
    assert made.at(MS) is True


def test_it_is_released_300_ms_after_the_newest_beat_arrived_and_not_before() -> None:
    made = held((1, 0), (2, 50))
    assert made.at(350 * MS) is True
    assert made.at(350 * MS + 1) is None
    assert made.releases == 1
    assert "silent for 0.3 s" in made.words


def test_a_gap_counts_though_nobody_looked_meanwhile() -> None:
    made = held((1, 0), (2, 400))
    assert (made.at(400 * MS), made.releases) == (True, 1)


def test_a_release_that_is_told_counts_at_once() -> None:
    made = held((1, 0))
    made.datagram(beat(2, 10 * MS, down=False), 10 * MS)
    assert (made.at(10 * MS), made.releases) == (False, 1)


def test_a_beat_that_lay_in_a_queue_holds_nothing() -> None:
    made = held((1, 0))
    made.datagram(beat(2, 50 * MS), 350 * MS)
    assert made.at(350 * MS) is True, "300 ms old"
    made = held((1, 0))
    made.datagram(beat(2, 50 * MS - 1), 350 * MS)
    assert (made.at(350 * MS), made.refused) == (None, 1)


@pytest.mark.parametrize("data", [b"", b"held", b"x" * 24, beat(1, 0)[:-1], beat(1, 0) + b"\0"])
def test_what_is_no_beat_holds_nothing(data: bytes) -> None:
    made = held()
    made.datagram(data, 0)
    assert (made.at(0), made.refused) == (None, 1)
    with pytest.raises(CodecError):
        decode_beat(data)


@pytest.mark.parametrize("number", [2, 1])
def test_a_beat_that_is_repeated_or_late_does_not_prolong_it(number: int) -> None:
    made = held((1, 0), (2, 50))
    made.datagram(beat(number, 200 * MS), 200 * MS)
    assert made.refused == 1
    assert made.at(351 * MS) is None


def test_a_stamp_of_another_clock_holds_nothing() -> None:
    made = held()
    made.datagram(beat(1, 6 * MS), 0)
    assert (made.at(0), made.refused) == (None, 1)


def test_a_console_that_was_started_anew_is_believed_once_the_last_is_silent() -> None:
    made = held((1000, 0))
    made.datagram(beat(1, 100 * MS), 100 * MS)
    assert made.refused == 1
    made.datagram(beat(2, 301 * MS, down=False), 301 * MS)
    assert made.at(301 * MS) is False


def test_a_page_that_holds_when_it_is_first_heard_must_release_first() -> None:
    made = held((1, 0))
    grip = OperatorGrip(made)
    assert grip.take(0) == Grip(False), "taped down"
    made.datagram(beat(2, 10 * MS, down=False), 10 * MS)
    assert grip.take(10 * MS) == Grip(False)
    made.datagram(beat(3, 20 * MS), 20 * MS)
    assert grip.take(20 * MS) == Grip(True)
    assert grip.ended(320 * MS) is None
    assert grip.ended(320 * MS + 1) == Grip(False)
    made.datagram(beat(4, 400 * MS), 400 * MS)
    assert grip.take(400 * MS) == Grip(False), "after silence too"


class Sender:
    """The console's end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._number = 0

    def send(self, at_ns: int, down: bool = True) -> None:
        self._number += 1
        self._socket.sendto(beat(self._number, at_ns, down), str(self._path))

    def close(self) -> None:
        self._socket.close()


def test_the_master_hears_it_at_once_and_its_end_without_waiting_for_a_command(tmp_path: Path) -> None:
    async def story() -> None:
        path, now_ns = tmp_path / "deadman.sock", [0]
        config = ConsoleHold(source="console", socket=path)
        switches = Switches(config, None, SHIPPED_DBC, {}, clock=lambda: now_ns[0])
        ended: list[Grip] = []
        told = asyncio.Event()

        def on_end(grip: Grip) -> None:
            ended.append(grip)
            told.set()

        switches.start(on_end, lambda _: None)
        assert path.stat().st_mode & 0o777 == 0o660
        sender = Sender(path)
        try:
            sender.send(0, down=False)
            assert switches.take() == Grip(False)
            sender.send(0)
            assert switches.take() == Grip(True)
            now_ns[0] = 100 * MS
            sender.send(now_ns[0], down=False)
            await asyncio.wait_for(told.wait(), 5.0)
            assert ended == [Grip(False)]
        finally:
            sender.close()
            switches.close()
        assert not path.exists()

    asyncio.run(story())


def test_silence_ends_it_by_the_masters_own_timer(tmp_path: Path) -> None:
    async def story() -> None:
        now_ns = [0]
        made = HeldElsewhere(0.1)
        listener = HoldSocket(tmp_path / "deadman.sock", made, lambda: now_ns[0])
        changed = asyncio.Event()
        listener.open(changed.set)
        sender = Sender(listener.path)
        try:
            sender.send(0)
            await asyncio.wait_for(changed.wait(), 5.0)
            assert made.at(0) is True
            changed.clear()
            now_ns[0] = to_ns(0.2)  # the timer looks after 0.1 s
            await asyncio.wait_for(changed.wait(), 5.0)
            assert made.at(now_ns[0]) is None
        finally:
            sender.close()
            listener.close()
            listener.close()

    asyncio.run(story())


def test_a_socket_that_was_left_behind_is_replaced_and_one_in_use_is_not(tmp_path: Path) -> None:
    async def story() -> None:
        path = tmp_path / "deadman.sock"
        left = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        left.bind(str(path))
        with pytest.raises(TandemError, match="another process listens"):
            HoldSocket(path, held()).open(lambda: None)
        left.close()
        listener = HoldSocket(path, held())
        listener.open(lambda: None)
        listener.close()
        path.write_text("a file")
        with pytest.raises(TandemError, match="no socket"):
            HoldSocket(path, held()).open(lambda: None)

    asyncio.run(story())
