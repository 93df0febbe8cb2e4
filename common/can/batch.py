"""All frames that wait on a SocketCAN socket in one call of the kernel, with the time at which each arrived.

python-can takes some 12 µs a frame, which is a fifth of a core at 16,000 frames a second. Here a frame takes
a tenth of that. Linux only, as SocketCAN is.
"""

from __future__ import annotations

import ctypes
import errno
import os
import socket
import struct
import sys
from collections.abc import Callable

import can

from common.can.reader import OnError
from common.clock import NS_PER_MS, NS_PER_S, monotonic_ns, wall_ns

AT_ONCE = 64
"""Frames in one call."""
MOST_CALLS = 16
"""In one `read`: a bus that never falls silent must not keep the loop. What still waits comes in the next."""
_FRAME_BYTES = 72
"""struct canfd_frame; a classic can_frame is its first 16 bytes (linux/can.h)."""
_FRAME = struct.Struct("=IB3x64s")
"""Identifier with flags, length, data."""
_CONTROL_BYTES = 32
_STAMP = struct.Struct("=16xqq")
"""After the head of a control message: seconds and nanoseconds of the wall clock."""
_SO_TIMESTAMPNS = 35
_OLDEST_NS = 500 * NS_PER_MS
"""A stamp further back than this was made before the wall clock was set: the frame counts from now."""
_READINGS = 3
"""Of both clocks, one after the other."""

Waiting = Callable[[list[tuple[int, bytes, int]]], None]
"""Takes frames: identifier with SocketCAN's flags, data, arrival in monotonic ns."""


class _Vector(ctypes.Structure):
    """C's struct iovec."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Header(ctypes.Structure):
    """C's struct msghdr."""

    _fields_ = (
        ("name", ctypes.c_void_p), ("name_length", ctypes.c_uint32), ("vectors", ctypes.POINTER(_Vector)),
        ("vector_count", ctypes.c_size_t), ("control", ctypes.c_void_p), ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )  # fmt: skip


class _Message(ctypes.Structure):
    """C's struct mmsghdr."""

    _fields_ = (("header", _Header), ("length", ctypes.c_uint))


def can_batch(interface: str) -> bool:
    """Whether an interface can be read so on this system."""
    return interface == "socketcan" and sys.platform == "linux" and hasattr(ctypes.CDLL(None), "recvmmsg")


class BatchReader:
    """Reads when it is asked to, and never by itself."""

    def __init__(self, number: int, on_frames: Waiting, on_failure: OnError) -> None:
        """`number`: the socket's descriptor. Raises OSError where it gives no times."""
        self._number, self._on_frames, self._on_failure = number, on_frames, on_failure
        self._stopped = False
        with socket.socket(fileno=os.dup(number)) as wire:
            wire.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._receive = ctypes.CDLL(None, use_errno=True).recvmmsg
        self._frames = ctypes.create_string_buffer(AT_ONCE * _FRAME_BYTES)
        self._controls = ctypes.create_string_buffer(AT_ONCE * _CONTROL_BYTES)
        self._vectors = (_Vector * AT_ONCE)()
        self._messages = (_Message * AT_ONCE)()
        frames, controls = ctypes.addressof(self._frames), ctypes.addressof(self._controls)
        for place in range(AT_ONCE):
            vector, header = self._vectors[place], self._messages[place].header
            vector.base, vector.length = frames + place * _FRAME_BYTES, _FRAME_BYTES
            header.vectors, header.vector_count = ctypes.pointer(vector), 1
            header.control, header.control_length = controls + place * _CONTROL_BYTES, _CONTROL_BYTES
        self._blank = bytes(self._messages)
        """As the kernel must find it: it writes the length of what it gave into each that it used."""
        self._used = 0

    def read(self) -> None:
        """Hand on all frames that wait, at most `AT_ONCE` times `MOST_CALLS`."""
        for _ in range(MOST_CALLS):
            if self._stopped or self._read_once() < AT_ONCE:
                return

    def _read_once(self) -> int:
        ctypes.memmove(self._messages, self._blank, self._used * ctypes.sizeof(_Message))
        self._used = 0
        count: int = self._receive(self._number, self._messages, AT_ONCE, socket.MSG_DONTWAIT, None)
        if count < 0:
            number = ctypes.get_errno()
            if number not in (errno.EAGAIN, errno.EINTR):
                self._on_failure(can.CanOperationError(os.strerror(number), number))
            return 0
        self._used = count
        self._on_frames(self._taken(count))
        return count

    def _taken(self, count: int) -> list[tuple[int, bytes, int]]:
        began_ns = _wall_minus_monotonic_ns()
        now_ns = monotonic_ns()
        oldest_ns = now_ns - _OLDEST_NS
        out = []
        frames = _FRAME.iter_unpack(memoryview(self._frames)[: count * _FRAME_BYTES])
        stamps = _STAMP.iter_unpack(memoryview(self._controls)[: count * _CONTROL_BYTES])
        for (can_id, length, data), (seconds, rest) in zip(frames, stamps, strict=True):
            at_ns = seconds * NS_PER_S + rest - began_ns
            out.append((can_id, data[:length], at_ns if oldest_ns < at_ns <= now_ns else now_ns))
        return out

    def stop(self) -> None:
        """Hand on nothing after this; the descriptor may be closed."""
        self._stopped = True

    def join(self) -> None:
        """There is nothing to wait for."""


def _wall_minus_monotonic_ns() -> int:
    """What to take from a time of the wall clock. The reading that was interrupted least counts."""
    tries = []
    for _ in range(_READINGS):
        before_ns, wall, after_ns = monotonic_ns(), wall_ns(), monotonic_ns()
        tries.append((after_ns - before_ns, wall - after_ns))
    return min(tries)[1]
