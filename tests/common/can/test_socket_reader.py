"""Frames as the kernel gives them, over a socket that carries the same bytes."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct

import can
import pytest

from common.can.reader import FRAMES_A_WAKE_UP
from common.can.socket_reader import KernelFrames, SocketReader

Taken = list[tuple[int, bytes, int]]
CLASSIC, FD = struct.Struct("=IB3x8s"), struct.Struct("=IBB2x64s")


def test_frames_of_both_kinds_are_read_with_their_flags_and_only_their_data() -> None:
    taken: Taken = []
    frames = KernelFrames(taken.extend)
    frames.take(CLASSIC.pack(0x105, 2, b"12345678"))
    frames.take(FD.pack(0x8000_0105, 24, 1, bytes(range(64))))
    frames.take(CLASSIC.pack(0x4000_0080, 0, b""))
    assert [(can_id, data) for can_id, data, _ in taken] == [
        (0x105, b"12"),
        (0x8000_0105, bytes(range(24))),
        (0x4000_0080, b""),
    ]


def test_it_reads_what_waits_but_not_for_ever_and_nothing_once_it_is_stopped() -> None:
    async def test() -> None:
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        taken: list[bytes] = []
        with near, far:
            reader = SocketReader(near.fileno(), asyncio.get_running_loop(), taken.append, lambda _: False)
            for number in range(FRAMES_A_WAKE_UP + 3):
                far.send(number.to_bytes(2, "big"))
            reader.read()
            assert len(taken) == FRAMES_A_WAKE_UP
            reader.stop()
            reader.read()
            assert len(taken) == FRAMES_A_WAKE_UP
            reader.stop()

    asyncio.run(test())


@pytest.mark.parametrize("goes_on", [False, True])
def test_an_error_of_the_socket_is_told_with_its_number(
    goes_on: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Broken:
        def __init__(self, **_: object) -> None:
            self.asked = 0

        def setblocking(self, flag: bool) -> None:
            assert not flag

        def recv(self, _: int) -> bytes:
            self.asked += 1
            if self.asked == 1:
                raise OSError(errno.ENETDOWN, "Network is down")
            raise BlockingIOError

        def close(self) -> None:
            pass

    async def test() -> None:
        near, far = socket.socketpair()
        errors: list[Exception] = []
        taken: list[bytes] = []

        def told(error: Exception) -> bool:
            errors.append(error)
            return goes_on

        with near, far, monkeypatch.context() as patch:
            patch.setattr("common.can.socket_reader.socket.socket", Broken)
            reader = SocketReader(near.fileno(), asyncio.get_running_loop(), taken.append, told)
            reader.read()
            reader.stop()
        assert [getattr(error, "error_code", None) for error in errors] == [errno.ENETDOWN]
        assert isinstance(errors[0], can.CanOperationError)
        assert not taken

    asyncio.run(test())
