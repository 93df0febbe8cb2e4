"""Reads a bus that is a socket as the kernel gives it, without python-can: SocketCAN, udp_multicast."""

from __future__ import annotations

import asyncio
import os
import socket
import struct
from collections.abc import Callable

import can
from can.interfaces.socketcan import SocketcanBus

from common.can.reader import FRAMES_A_WAKE_UP, OnError
from common.clock import monotonic_ns

_LONGEST = 4096
"""Bytes of a datagram, as in python-can."""
_HEAD = struct.Struct("=IB3x")
"""Of struct can_frame and canfd_frame: identifier with flags, length of the data (linux/can.h)."""

OnFrames = Callable[[list[tuple[int, bytes, int]]], None]
"""Takes frames: identifier with SocketCAN's flags, data, when it was read in monotonic ns."""


class SocketReader:
    """Reads when the loop says that the bus can be read, as `reader.DescriptorReader` does."""

    def __init__(
        self, number: int, loop: asyncio.AbstractEventLoop, take: Callable[[bytes], None], on_error: OnError
    ) -> None:
        """`number`: the socket's descriptor; `take` takes what was received, one by one."""
        self._number, self._loop, self._take, self._on_failure = number, loop, take, on_error
        self._stopped = False
        self._wire = socket.socket(fileno=os.dup(number))
        self._wire.setblocking(False)
        loop.add_reader(number, self.read)

    def read(self) -> None:
        """Call back for each that waits, but not for ever."""
        for _ in range(FRAMES_A_WAKE_UP):
            if self._stopped:
                return
            try:
                received = self._wire.recv(_LONGEST)
            except BlockingIOError:
                return
            except OSError as error:
                failed = can.CanOperationError(f"cannot be read: {error.strerror}", error.errno)
                if not self._on_failure(failed):
                    return
                continue
            self._take(received)

    def stop(self) -> None:
        """Let go of the descriptor; it may be closed after this."""
        if not self._stopped:
            self._stopped = True
            self._loop.remove_reader(self._number)
            self._wire.close()

    def join(self) -> None:
        """There is nothing to wait for."""


class KernelFrames:
    """Takes frames as a SocketCAN socket gives them: 3 µs a frame, where python-can takes 12."""

    def __init__(self, on_frames: OnFrames) -> None:
        self._on_frames = on_frames

    def take(self, received: bytes) -> None:
        """One frame, of classic CAN or CAN FD."""
        can_id, length = _HEAD.unpack_from(received)
        begin = _HEAD.size
        self._on_frames([(can_id, received[begin : begin + length], monotonic_ns())])


def is_socketcan(bus: can.BusABC) -> bool:
    """Whether a bus is a socket of the kernel's CAN."""
    return isinstance(bus, SocketcanBus)
