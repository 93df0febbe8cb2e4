"""One CAN bus on the event loop: frames in by callback, frames out by `send`.

Nothing that happens on the bus is raised into the session once `open` has returned: `kept_open` reopens it.
"""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable
from dataclasses import asdict
from functools import reduce
from operator import or_

import can

from common.can.batch import BatchReader, can_batch
from common.can.config import BusConfig
from common.can.controller import RESTARTED, Controller, error_words, of_error_frame
from common.can.datagrams import DatagramFrames, sends_datagrams
from common.can.echo import SentFrames
from common.can.frame import EXTENDED, CanFrame
from common.can.interface import descriptor, error_number, open_bus
from common.can.kept_open import KeptOpenBus, OnChange, Opener, StateOf
from common.can.netlink import state_of
from common.can.reader import Reader
from common.can.socket_reader import KernelFrames, SocketReader, is_socketcan
from common.clock import monotonic_ns
from common.metrics.bus import BusMetrics

SEND_ERRORS_IN_A_ROW = 20
"""A full queue is no reason to reopen a bus, but one that stays full is: 0.1 s at 200 Hz."""
_QUEUE_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})

_ERROR_FRAME, _REMOTE = 0x2000_0000, 0x4000_0000
"""SocketCAN's flags in an identifier (linux/can.h)."""
_NO_DATA_FRAME = _ERROR_FRAME | _REMOTE

OnFrame = Callable[[str, int, bytes, int], object]
"""(bus name, identifier, data, arrival in monotonic ns)."""
OnFrames = Callable[[str, list[tuple[int, bytes, int]]], object]
"""(bus name, frames as above)."""
OnRemote = Callable[[str, int, int], object]
"""(bus name, identifier, arrival in monotonic ns)."""
Arrival = Callable[[can.Message], int]
"""When a message arrived, monotonic ns."""


def read_now(message: can.Message) -> int:
    """It counts from when it is read."""
    return monotonic_ns()


def _message_of(can_id: int, data: bytes) -> can.Message:
    return can.Message(
        arbitration_id=can_id & 0x1FFF_FFFF,
        is_extended_id=bool(can_id & EXTENDED),
        is_error_frame=bool(can_id & _ERROR_FRAME),
        is_remote_frame=bool(can_id & _REMOTE),
        is_fd=len(data) > 8,
        data=b"" if can_id & _REMOTE else data,
    )


class CanBus(KeptOpenBus):
    """A bus that is kept open. Use it from the event loop on which `open` was called."""

    def __init__(
        self,
        config: BusConfig,
        on_frame: OnFrame,
        on_change: OnChange | None = None,
        opener: Opener = open_bus,
        *,
        on_second_sender: OnFrame | None = None,
        take_extended: bool = False,
        on_remote: OnRemote | None = None,
        state_of: StateOf = state_of,
        arrived: Arrival = read_now,
        in_batches: bool = False,
        on_frames: OnFrames | None = None,
    ) -> None:
        """`on_second_sender` takes frames with an identifier that this side sends, but did not send.

        `take_extended`: frames with 29 bits are handed on too; else they are counted as foreign. `on_remote`
        takes the identifiers of others' remote requests, of 11 bits. `in_batches`: where the interface can,
        frames wait until `read` is called, and then come with the times at which the kernel took them in.
        `on_frames` takes several at once, where it is given.
        """
        self._take_extended = take_extended
        self._in_batches = in_batches and can_batch(config.interface)
        super().__init__(config, on_change, opener, state_of)
        self._on_frame = on_frame
        self._on_frames = on_frames
        self._arrived = arrived
        self._on_second_sender = on_second_sender
        self._on_remote = on_remote
        echoes = config.interface == "udp_multicast" or bool(config.options.get("receive_own_messages"))
        self._sent = SentFrames(echoes)
        self._sent_ids: set[int] = set()

    def metrics(self) -> BusMetrics:
        """State and counters."""
        state = "" if self.state is None else str(self.state)
        return BusMetrics(**asdict(self.counters), up=self.up, state=state, last_error=self.last_error)

    def send(self, frame: CanFrame) -> None:
        """Send without waiting. Never raises: what cannot be sent is counted, and brings the bus down."""
        if not frame.remote:  # its identifier is that of another's frame
            self._sent_ids.add(frame.id)
        if self._on_second_sender is not None and not frame.remote:
            self._sent.sent(frame.id, frame.data, monotonic_ns())
        bus = self._bus
        if bus is None:
            self.counters.send_errors += 1
            return
        message = can.Message(
            arbitration_id=frame.id & ~EXTENDED,
            is_extended_id=bool(frame.id & EXTENDED),
            is_remote_frame=frame.remote,
            data=frame.data,
            is_fd=frame.fd,
            bitrate_switch=frame.fd,
        )
        try:
            # timeout 0: udp_multicast would block the loop without
            bus.send(message, timeout=0)
        except Exception as error:  # whatever a driver raises, the session goes on
            self._on_send_error(error)
            return
        self.counters.sent += 1
        self._send_errors_in_a_row = 0
        self._attempt = 0

    def _reader_of(self, bus: can.BusABC) -> Reader:
        number, failed = descriptor(bus), self._on_receive_error
        if number is not None and self._in_batches:
            return BatchReader(number, self._on_batch, failed)
        take: Callable[[bytes], None] | None = None
        if sends_datagrams(bus):
            take = DatagramFrames(self._config.fd, self._on_batch, self._on_message, failed).take
        elif is_socketcan(bus):
            take = KernelFrames(self._on_batch).take
        # python-can tells the kernel's stamps
        if number is None or take is None or self._arrived is not read_now:
            return super()._reader_of(bus)
        return SocketReader(number, asyncio.get_running_loop(), take, failed)

    def _on_batch(self, frames: list[tuple[int, bytes, int]]) -> None:
        """Data frames go on at once; what is rare takes the way of a python-can message."""
        if self._on_frames is not None and not self._doubtful and self._all_ordinary(frames):
            self.counters.received += len(frames)
            self._attempt = 0
            self._on_frames(self.name, frames)
            return
        on_frame, name, received = self._on_frame, self.name, 0
        for frame_id, data, at_ns in frames:
            if (
                frame_id & _NO_DATA_FRAME
                or frame_id in self._sent_ids
                or (frame_id & EXTENDED and not self._take_extended)
            ):
                self._on_message(_message_of(frame_id, data))
                if self._reader is None:
                    break  # this frame told that the bus has failed
            else:
                received += 1
                if self._doubtful:
                    self._on_the_bus()
                on_frame(name, frame_id, data, at_ns)
        if received:
            self.counters.received += received
            self._attempt = 0

    def _all_ordinary(self, frames: list[tuple[int, bytes, int]]) -> bool:
        """Whether all are data frames of others, with identifiers that are handed on."""
        identifiers = {frame_id for frame_id, _, _ in frames}
        rare = _NO_DATA_FRAME if self._take_extended else _NO_DATA_FRAME | EXTENDED
        return not reduce(or_, identifiers, 0) & rare and self._sent_ids.isdisjoint(identifiers)

    def _on_message(self, message: can.Message) -> None:
        counters = self.counters
        frame_id = message.arbitration_id
        if type(frame_id) is not int:  # udp_multicast carries whatever msgpack can, 256.0 too
            counters.undecodable += 1
        elif message.is_error_frame:
            self._on_error_frame(frame_id, bytes(message.data))
        elif message.is_remote_frame and not message.is_extended_id and self._on_remote is not None:
            self._on_remote(self.name, frame_id, monotonic_ns())
        elif message.is_remote_frame or (message.is_extended_id and not self._take_extended):
            counters.foreign += 1
        elif message.is_extended_id:
            counters.received += 1
            self._attempt = 0
            self._on_the_bus()
            self._on_frame(self.name, frame_id | EXTENDED, bytes(message.data), monotonic_ns())
        elif frame_id in self._sent_ids:
            counters.own_heard += 1
            self._on_own_id(frame_id, bytes(message.data))
        else:
            counters.received += 1
            self._attempt = 0
            self._on_the_bus()
            self._on_frame(self.name, frame_id, bytes(message.data), self._arrived(message))

    def _on_own_id(self, frame_id: int, data: bytes) -> None:
        now_ns = monotonic_ns()
        if self._on_second_sender is not None and not self._sent.is_echo(frame_id, data, now_ns):
            self.counters.second_sender += 1
            self._on_second_sender(self.name, frame_id, data, now_ns)

    def _on_error_frame(self, error_id: int, data: bytes) -> None:
        self.counters.error_frames += 1
        if self._config.interface != "socketcan":  # the layout is SocketCAN's
            self._warn("error frame", f"error frame {error_id:#x}")
            return
        state = of_error_frame(error_id, data)
        if state is not Controller.BUS_OFF:
            self._warn("error frame", error_words(error_id, data))
        self._on_state(state)
        if error_id & RESTARTED and state is not Controller.BUS_OFF:
            self._on_the_bus()

    def _on_receive_error(self, error: Exception) -> bool:
        """Whether to read on: the error was in what arrived (udp_multicast), and not in the bus."""
        bad_frame = isinstance(error, can.CanOperationError) and error.__cause__ is not None
        if bad_frame and error_number(error) is None:
            self.counters.undecodable += 1
            self._warn("undecodable", f"received a datagram that is no CAN frame ({error.__cause__})")
            return True
        self._fail(f"receiving failed: {error}")
        return False

    def _on_send_error(self, error: Exception) -> None:
        self.counters.send_errors += 1
        self._send_errors_in_a_row += 1
        full = error_number(error) in _QUEUE_FULL or "buffer full" in str(error)
        if not full or self._send_errors_in_a_row >= SEND_ERRORS_IN_A_ROW:
            self._fail(f"sending failed: {error}")
        else:
            self._warn("send", f"sending failed: {error}")
