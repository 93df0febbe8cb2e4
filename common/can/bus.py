"""One CAN bus on the event loop: frames in by callback, frames out by `send`, reopened when it fails.

    DOWN ──open──▶ UP ──error──▶ DOWN ─ 0.1 s, 0.2 s, … 2 s ─▶ UP

Nothing that happens on the bus is raised into the session once `open` has returned.
"""

from __future__ import annotations

import asyncio
import errno
import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass

import can

from common.can.config import BusConfig
from common.can.echo import Echo
from common.can.frame import Frame
from common.can.interface import descriptor, error_number, open_bus
from common.can.reader import DescriptorReader, Reader, ThreadReader
from common.can.state import (
    CANNOT_SPEAK,
    RESTARTED,
    Controller,
    ask_kernel,
    bus_off_words,
    error_words,
    of_error_frame,
    state_of,
)
from common.clock import monotonic_ns
from common.errors import BusError
from common.log.throttle import LogThrottle

FIRST_WAIT_S = 0.1
LONGEST_WAIT_S = 2.0
SEND_ERRORS_IN_A_ROW = 20
"""A full queue is no reason to reopen a bus, but one that stays full is: 0.1 s at 200 Hz."""
_QUEUE_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})
_LASTING = (NotImplementedError, ImportError, TypeError, ValueError)
"""Behind a BusError: what no waiting mends."""

OnFrame = Callable[[str, int, bytes, int], object]
"""(bus name, identifier, data, arrival in monotonic ns)."""
OnChange = Callable[[str, bool], object]
"""(bus name, whether it is up)."""
Opener = Callable[[BusConfig], can.BusABC]
StateOf = Callable[[BusConfig, can.BusABC], Controller | None]
"""How the controller of an open bus stands, None where nothing tells."""

log = logging.getLogger(__name__)


@dataclass(slots=True)
class BusCounters:
    """One bus since the start."""

    received: int = 0
    """Frames handed on."""
    sent: int = 0
    send_errors: int = 0
    undecodable: int = 0
    """Datagrams of a udp_multicast group that are no CAN frame."""
    own_heard: int = 0
    """Frames with an identifier this side sends: its echo on udp_multicast, elsewhere a second sender."""
    second_sender: int = 0
    """Those of them that are no echo: another program, or device, sends what only this side should."""
    foreign: int = 0
    """Frames with a 29-bit identifier, and remote frames: not of this protocol."""
    error_frames: int = 0
    times_down: int = 0
    failed_opens: int = 0


def wait_s(attempt: int) -> float:
    """How long to wait before the attempt (0 is the first) to reopen a bus."""
    return float(min(FIRST_WAIT_S * 2 ** min(attempt, 10), LONGEST_WAIT_S))


def is_bad_frame(error: BaseException) -> bool:
    """Whether `recv` failed on the content of what arrived (udp_multicast), and not on the bus."""
    cause = error.__cause__
    return isinstance(error, can.CanOperationError) and cause is not None and error_number(error) is None


class CanBus:
    """A bus that is kept open. Use it from the event loop on which `open` was called."""

    def __init__(
        self,
        config: BusConfig,
        on_frame: OnFrame,
        on_change: OnChange | None = None,
        opener: Opener = open_bus,
        *,
        on_second_sender: OnFrame | None = None,
        state_of: StateOf = state_of,
    ) -> None:
        """`on_second_sender` is told of frames with an identifier of this side's that it did not send."""
        self.name = config.name
        self.counters = BusCounters()
        self.last_error = ""
        self.state: Controller | None = None
        """The controller's, by its last error frame; None where it has not told."""
        self._state_of = state_of
        self._doubtful = False
        """Open again after bus-off, but nothing has shown yet that the controller is on the bus."""
        self._config = config
        self._on_frame = on_frame
        self._on_change = on_change
        self._on_second_sender = on_second_sender
        echoes = config.interface == "udp_multicast" or bool(config.options.get("receive_own_messages"))
        self._echo = Echo(echoes)
        self._opener = opener
        self._bus: can.BusABC | None = None
        self._reader: Reader | None = None
        self._sent_ids: set[int] = set()
        self._send_errors_in_a_row = 0
        self._attempt = 0
        self._reopening: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()
        self._throttle = LogThrottle()

    @property
    def up(self) -> bool:
        """Whether the bus is open, and its controller not known to be off it."""
        return self._bus is not None and not self._doubtful

    def open(self) -> None:
        """Open the bus for the first time. Raises BusError where it cannot be opened at all."""
        if self._bus is None and self._reopening is None:
            bus = self._opener(self._config)
            self.state = self._state_of(self._config, bus)
            if self.state in CANNOT_SPEAK:
                bus.shutdown()
                raise BusError(f"bus {self.name}: {self._off_words(self.state)}")
            self._attach(bus)

    def open_or_retry(self) -> None:
        """Open the bus; one that is not there yet is tried again with back-off, as one that fails later is.

        Raises BusError where no waiting helps: an interface that python-can does not have, wrong options.
        """
        try:
            self.open()
        except BusError as error:
            if isinstance(error.__cause__, _LASTING):
                raise
            self.counters.failed_opens += 1
            self.last_error = str(error)
            self._say("open", f"{error}; it is tried again until it opens")
            self._reopening = asyncio.get_running_loop().create_task(self._reopen(None, None))

    async def close(self) -> None:
        """Close it for good. May be called again."""
        self._closing.set()
        bus, reader = self._detach()
        if bus is not None:
            await asyncio.to_thread(_shut_down, bus, reader)
        if self._reopening is not None:
            await self._reopening

    def close_now(self) -> None:
        """Close it for good, where nothing can be awaited: blocks while the driver lets go of it."""
        self._closing.set()
        bus, reader = self._detach()
        if bus is not None:
            _shut_down(bus, reader)

    def send(self, frame: Frame) -> None:
        """Send without waiting. Never raises: what cannot be sent is counted, and brings the bus down."""
        self._sent_ids.add(frame.id)
        if self._on_second_sender is not None:
            self._echo.sent(frame.id, frame.data, monotonic_ns())
        bus = self._bus
        if bus is None:
            self.counters.send_errors += 1
            return
        message = can.Message(
            arbitration_id=frame.id,
            is_extended_id=False,
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

    def read(self) -> None:
        """Hand on the frames that wait, now."""
        if self._reader is not None:
            self._reader.read()

    def summary(self) -> dict[str, bool | int | str]:
        """State and counters as plain values."""
        state = "" if self.state is None else str(self.state)
        return {"up": self.up, "state": state, "last_error": self.last_error, **asdict(self.counters)}

    def _on_message(self, message: can.Message) -> None:
        counters = self.counters
        frame_id = message.arbitration_id
        if type(frame_id) is not int:  # udp_multicast carries whatever msgpack can, 256.0 too
            counters.undecodable += 1
        elif message.is_error_frame:
            self._on_error_frame(frame_id, bytes(message.data))
        elif message.is_extended_id or message.is_remote_frame:
            counters.foreign += 1
        elif frame_id in self._sent_ids:
            counters.own_heard += 1
            if self._on_second_sender is not None:
                self._on_own_id(frame_id, bytes(message.data))
        else:
            counters.received += 1
            self._attempt = 0
            if self._doubtful:
                self._back()
            self._on_frame(self.name, frame_id, bytes(message.data), monotonic_ns())

    def _on_own_id(self, frame_id: int, data: bytes) -> None:
        now_ns = monotonic_ns()
        if self._on_second_sender is not None and not self._echo.is_ours(frame_id, data, now_ns):
            self.counters.second_sender += 1
            self._on_second_sender(self.name, frame_id, data, now_ns)

    def _on_error_frame(self, error_id: int, data: bytes) -> None:
        self.counters.error_frames += 1
        if self._config.interface != "socketcan":  # the layout is SocketCAN's
            self._say("error frame", f"error frame {error_id:#x}")
            return
        state = of_error_frame(error_id, data)
        self.state = state or self.state
        if state is Controller.BUS_OFF:
            self._doubtful = True
            self._fail(self._off_words(state))
            return
        self._say("error frame", error_words(error_id, data))
        if error_id & RESTARTED and self._doubtful:
            self._back()

    def _off_words(self, state: Controller | None) -> str:
        channel = self._config.channel
        if state is not Controller.BUS_OFF:
            return f"the controller of {channel} is {state}"
        link = ask_kernel(channel) if self._config.interface == "socketcan" else None
        return bus_off_words(channel, link)

    def _back(self) -> None:
        """Something has shown that the controller is on the bus again."""
        self._doubtful = False
        log.info("bus %s: up again", self.name)
        if self._on_change is not None:
            self._on_change(self.name, True)

    def _on_recv_error(self, error: Exception) -> bool:
        if is_bad_frame(error):
            self.counters.undecodable += 1
            self._say("undecodable", f"a datagram that is no CAN frame ({error.__cause__})")
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
            self._say("send", f"sending failed: {error}")

    def _attach(self, bus: can.BusABC) -> None:
        loop = asyncio.get_running_loop()
        number = descriptor(bus)
        self._bus = bus
        self._send_errors_in_a_row = 0
        if number is None:
            self._reader = ThreadReader(bus, loop, self._on_message, self._on_recv_error)
        else:
            self._reader = DescriptorReader(bus, number, loop, self._on_message, self._on_recv_error)
        if self._on_change is not None and not self._doubtful:
            self._on_change(self.name, True)

    def _detach(self) -> tuple[can.BusABC | None, Reader | None]:
        bus, reader = self._bus, self._reader
        self._bus = self._reader = None
        if reader is not None:
            reader.stop()
        return bus, reader

    def _fail(self, reason: str) -> None:
        bus, reader = self._detach()
        if bus is None:
            return
        self.counters.times_down += 1
        self.last_error = reason
        self._say("down", f"down: {reason}; it will be reopened")
        self._reopening = asyncio.get_running_loop().create_task(self._reopen(bus, reader))
        if self._on_change is not None:
            self._on_change(self.name, False)

    async def _reopen(self, failed: can.BusABC | None, reader: Reader | None) -> None:
        if failed is not None:
            await asyncio.to_thread(_shut_down, failed, reader)
        while not await self._closes_within(wait_s(self._attempt)):
            self._attempt += 1
            try:
                # off the loop: an adapter may take its time, and other buses go on
                bus = await asyncio.to_thread(self._opener, self._config)
            except BusError as error:
                self.counters.failed_opens += 1
                self.last_error = str(error)
                self._say("open", str(error))
                continue
            # a socket opens whatever the controller does: only the controller tells whether the bus works
            state = await asyncio.to_thread(self._state_of, self._config, bus)
            self.state = state or self.state
            if state in CANNOT_SPEAK and not self._closing.is_set():
                await asyncio.to_thread(_shut_down, bus, None)
                self.last_error = self._off_words(state)
                self._say("off", f"still {state}: {self.last_error}")
                continue
            self._reopening = None
            if self._closing.is_set():
                await asyncio.to_thread(_shut_down, bus, None)
                return
            self._doubtful = self._doubtful and state is None
            if self._doubtful:
                log.info("bus %s: opened; counts as up once a frame arrives", self.name)
            else:
                log.info("bus %s: up again", self.name)
            self._attach(bus)
            return

    async def _closes_within(self, seconds: float) -> bool:
        try:
            await asyncio.wait_for(self._closing.wait(), seconds)
        except TimeoutError:
            return False
        return True

    def _say(self, key: str, text: str) -> None:
        times = self._throttle.passes(monotonic_ns(), key)
        if times:
            log.warning("bus %s: %s%s", self.name, text, f" ({times} times)" if times > 1 else "")


def _shut_down(bus: can.BusABC, reader: Reader | None) -> None:
    if reader is not None:
        reader.join()
    try:
        bus.shutdown()
    except Exception as error:  # it has failed already; there is nothing left to save
        log.info("bus %s: error while closing: %s", bus.channel_info, error)
