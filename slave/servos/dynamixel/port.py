"""The serial port as `dynamixel_sdk`'s packet handler wants it, without its spinning and its wall clock.

The library's own port polls until a packet is whole: a thread that does so keeps the interpreter's
lock from the 200 Hz loop. This one sleeps in the kernel until there are bytes.
"""

from __future__ import annotations

import contextlib
import os
import select
import termios
import time
from collections.abc import Iterator

import serial

from common.errors import RobotError

_BITS_PER_BYTE = 10
_AT_ONCE_BYTES = 4096


class PortLostError(RobotError):
    """A serial port that cannot be opened, or whose adapter has gone."""


class Port:
    """What the packet handler calls, by the names it calls them. Not thread-safe."""

    def __init__(self, device: str, baud: int, reply_timeout_s: float) -> None:
        """Raises PortLostError naming the device."""
        self.is_using = False  # the packet handler's own mark
        self._device = device
        self.reply_timeout_s = reply_timeout_s
        """Waited for an answer beyond its time on the wire."""
        self._byte_s = _BITS_PER_BYTE / baud
        self._deadline_s = 0.0
        self._received = b""
        self.late_bytes = 0
        """Bytes that came after the time-out."""
        with self._named():
            # the adapter would rather fail than let two programs write to one robot
            self._serial = serial.Serial(device, baud, timeout=0, write_timeout=1.0, exclusive=True)

    def close(self) -> None:
        """Safe to call twice."""
        with contextlib.suppress(OSError, termios.error):
            self._serial.close()

    def clearPort(self) -> None:  # noqa: N802
        """Forget what was received before a request: it answers something older."""
        with self._named():
            self.late_bytes += len(self._received) + self._serial.in_waiting
            self._received = b""
            self._serial.reset_input_buffer()

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        """Bytes written. Raises PortLostError."""
        with self._named():
            return self._serial.write(bytes(packet)) or 0

    def readPort(self, length: int) -> bytes:  # noqa: N802
        """Up to `length` bytes: of those there are by now, or that come first before the time is up."""
        if length <= 0:
            return b""
        if not self._received:
            with self._named():
                wait_s = max(0.0, self._deadline_s - time.monotonic())
                if not select.select([self._serial.fileno()], [], [], wait_s)[0]:
                    return b""
                # more than was asked for: the answers of many servos come in one piece
                self._received = bytes(self._serial.read(_AT_ONCE_BYTES))
        out, self._received = self._received[:length], self._received[length:]
        return out

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802
        """So many bytes are expected from now on."""
        self._deadline_s = time.monotonic() + self.reply_timeout_s + packet_length * self._byte_s

    def isPacketTimeout(self) -> bool:  # noqa: N802
        """Whether they should have come by now."""
        return time.monotonic() >= self._deadline_s

    def settle(self) -> None:
        """Throw away what comes late: wait as long as any answer may take."""
        self.setPacketTimeout(0)
        while not self.isPacketTimeout():
            self.readPort(_AT_ONCE_BYTES)

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        # ValueError: the library's word for a port that was closed, or cannot do this rate
        try:
            yield
        except (OSError, termios.error, ValueError, TypeError) as error:
            raise PortLostError(f"{self._device}: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    return str(error) or type(error).__name__
