"""A python-can bus that is opened, watched, and reopened when it fails.

DOWN ──open──▶ UP ──error──▶ DOWN ─ 0.1 s, 0.2 s, … 2 s ─▶ UP
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable

import can

from common.can.config import BusConfig
from common.can.controller import CANNOT_SPEAK, Controller, bus_off_words
from common.can.interface import descriptor
from common.can.netlink import ask_kernel
from common.can.reader import DescriptorReader, Reader, ThreadReader
from common.clock import monotonic_ns
from common.errors import BusError
from common.log.throttle import LogThrottle
from common.metrics.bus import BusCounters

FIRST_WAIT_S = 0.1
LONGEST_WAIT_S = 2.0
_LASTING = (NotImplementedError, ImportError, TypeError, ValueError)
"""Behind a BusError: what no waiting mends."""

OnChange = Callable[[str, bool], object]
"""(bus name, whether it is up)."""
Opener = Callable[[BusConfig], can.BusABC]
StateOf = Callable[[BusConfig, can.BusABC], Controller | None]
"""The controller's state of an open bus; None if it is not known."""

log = logging.getLogger(__name__)


def wait_s(attempt: int) -> float:
    """How long to wait before the attempt (0 is the first) to reopen a bus."""
    return float(min(FIRST_WAIT_S * 2 ** min(attempt, 10), LONGEST_WAIT_S))


class KeptOpenBus(ABC):
    """Opens a bus, and opens it again after each failure. `CanBus` adds what travels on it."""

    def __init__(
        self, config: BusConfig, on_change: OnChange | None, opener: Opener, state_of: StateOf
    ) -> None:
        self.name = config.name
        self.counters = BusCounters()
        self.last_error = ""
        """Why the bus last failed or did not open; empty before."""
        self.state: Controller | None = None
        """The controller's, by its last error frame; None before the first."""
        self._config = config
        self._on_change = on_change
        self._opener = opener
        self._state_of = state_of
        self._bus: can.BusABC | None = None
        self._reader: Reader | None = None
        self._doubtful = False
        """Open again after bus-off, but nothing has shown yet that the controller is on the bus."""
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
                raise BusError(f"bus {self.name}: {self._why_silent(self.state)}")
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
            self._warn("open", f"{error}; retrying until it opens")
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

    def _fail(self, reason: str) -> None:
        """Take the bus down and begin to reopen it."""
        bus, reader = self._detach()
        if bus is None:
            return
        self.counters.times_down += 1
        self.last_error = reason
        self._warn("down", f"down: {reason}; reopening it")
        self._reopening = asyncio.get_running_loop().create_task(self._reopen(bus, reader))
        if self._on_change is not None:
            self._on_change(self.name, False)

    def _on_the_bus(self) -> None:
        """Something has shown that the controller is on the bus, perhaps again."""
        if self._doubtful:
            self._doubtful = False
            log.info("bus %s: up again", self.name)
            if self._on_change is not None:
                self._on_change(self.name, True)

    def _on_state(self, state: Controller | None) -> None:
        """An error frame came, with the controller's state, or None if it holds no state."""
        self.state = state or self.state
        if state is Controller.BUS_OFF:
            self._doubtful = True
            self._fail(self._why_silent(state))

    def read(self) -> None:
        """Hand on the frames that wait, now."""
        if self._reader is not None:
            self._reader.read()

    def _warn(self, kind: str, text: str) -> None:
        """Log a fault, once a second for each kind."""
        times = self._throttle.passes(monotonic_ns(), kind)
        if times:
            # the words of a BusError begin with the bus already
            text = text.removeprefix(f"bus {self.name}: ")
            log.warning("bus %s: %s%s", self.name, text, f" ({times} times)" if times > 1 else "")

    @abstractmethod
    def _on_message(self, message: can.Message) -> None:
        """Take what came in."""

    @abstractmethod
    def _on_receive_error(self, error: Exception) -> bool:
        """Whether to read on after an error of receiving."""

    def _why_silent(self, state: Controller | None) -> str:
        channel = self._config.channel
        if state is not Controller.BUS_OFF:
            return f"the controller of {channel} is {state}"
        report = ask_kernel(channel) if self._config.interface == "socketcan" else None
        return bus_off_words(channel, report.restart_ms if report is not None else 0)

    def _attach(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._send_errors_in_a_row = 0
        self._reader = self._reader_of(bus)
        if self._on_change is not None and not self._doubtful:
            self._on_change(self.name, True)

    def _reader_of(self, bus: can.BusABC) -> Reader:
        loop, number = asyncio.get_running_loop(), descriptor(bus)
        if number is None:
            return ThreadReader(bus, loop, self._on_message, self._on_receive_error)
        return DescriptorReader(bus, number, loop, self._on_message, self._on_receive_error)

    def _detach(self) -> tuple[can.BusABC | None, Reader | None]:
        bus, reader = self._bus, self._reader
        self._bus = self._reader = None
        if reader is not None:
            reader.stop()
        return bus, reader

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
                self._warn("open", str(error))
                continue
            # a socket opens whatever the controller does: only the controller's state shows if the bus works
            state = await asyncio.to_thread(self._state_of, self._config, bus)
            self.state = state or self.state
            if state in CANNOT_SPEAK and not self._closing.is_set():
                await asyncio.to_thread(_shut_down, bus, None)
                self.last_error = self._why_silent(state)
                self._warn("off", f"still {state}: {self.last_error}")
                continue
            self._reopening = None
            if self._closing.is_set():
                await asyncio.to_thread(_shut_down, bus, None)
                return
            self._doubtful = self._doubtful and state is None
            opened = "opened; counts as up once a frame arrives" if self._doubtful else "up again"
            log.info("bus %s: %s", self.name, opened)
            self._attach(bus)
            return

    async def _closes_within(self, seconds: float) -> bool:
        try:
            await asyncio.wait_for(self._closing.wait(), seconds)
        except TimeoutError:
            return False
        return True


def _shut_down(bus: can.BusABC, reader: Reader | None) -> None:
    if reader is not None:
        reader.join()
    try:
        bus.shutdown()
    except Exception as error:  # it has failed already; there is nothing left to save
        log.info("bus %s: error while closing: %s", bus.channel_info, error)
