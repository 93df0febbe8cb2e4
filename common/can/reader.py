"""Two ways to hear a python-can bus from an event loop: by its file descriptor, or by a thread.

Why not can.Notifier, which does both: with a descriptor it lets an error of `recv` out into the event loop
instead of telling a listener, so that a bus that is gone fails again and again; with a thread it tells the
listener and then dies of the error. It also takes one frame a wake-up, which measured a little dearer.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

import can

FRAMES_A_WAKE_UP = 64
"""A bus that never falls silent must not keep the loop from its timers."""
_THREAD_WAIT_S = 0.05

OnMessage = Callable[[can.Message], None]
OnError = Callable[[Exception], bool]
"""Called with an error, on the loop. True: it was one bad frame, read on. False: the bus has failed."""


class Reader(Protocol):
    """Calls back on the loop for each message until stopped."""

    def stop(self) -> None:
        """No more callbacks after this. Does not wait."""

    def join(self) -> None:
        """Wait until the bus is no longer touched; call it off the loop."""

    def read(self) -> None:
        """Call back now for what waits, without waiting for the loop's turn."""


class DescriptorReader:
    """Reads when the loop says that the bus can be read."""

    def __init__(
        self,
        bus: can.BusABC,
        number: int,
        loop: asyncio.AbstractEventLoop,
        on_message: OnMessage,
        on_error: OnError,
    ) -> None:
        self._bus, self._number, self._loop = bus, number, loop
        self._on_message, self._on_failure = on_message, on_error
        self._stopped = False
        loop.add_reader(number, self.read)

    def read(self) -> None:
        """Call back for each message that waits, but not for ever."""
        if self._stopped:
            return
        for _ in range(FRAMES_A_WAKE_UP):
            try:
                message = self._bus.recv(0)
            except Exception as error:  # whatever a driver raises, the session goes on
                if self._on_failure(error):
                    continue
                return
            if message is None:
                return
            self._on_message(message)
            if self._stopped:
                return

    def stop(self) -> None:
        """Let go of the descriptor; it may be closed after this."""
        if not self._stopped:
            self._stopped = True
            self._loop.remove_reader(self._number)

    def join(self) -> None:
        """There is nothing to wait for."""


class ThreadReader:
    """Reads in a thread, where an interface has no descriptor (`virtual`, and adapters on other systems)."""

    def __init__(
        self, bus: can.BusABC, loop: asyncio.AbstractEventLoop, on_message: OnMessage, on_error: OnError
    ) -> None:
        self._bus, self._loop = bus, loop
        self._on_message, self._on_failure = on_message, on_error
        self._stopped = threading.Event()
        self._waiting: deque[can.Message] = deque()
        self._thread = threading.Thread(target=self._read, name=f"can {bus.channel_info}", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._stopped.is_set():
            try:
                message = self._bus.recv(_THREAD_WAIT_S)
            except Exception as error:  # whatever a driver raises, the session goes on
                self._hand_over(self._on_error, error)
                # a failed bus is stopped by the loop; until then do not spin on its error
                self._stopped.wait(_THREAD_WAIT_S)
                continue
            if message is not None:
                self._waiting.append(message)
                self._hand_over(self.read)

    def _hand_over(self, callback: Callable[..., None], *values: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has closed
            self._loop.call_soon_threadsafe(callback, *values)

    def _on_error(self, error: Exception) -> None:
        if not self._stopped.is_set():
            self._on_failure(error)

    def read(self) -> None:
        """Call back for each message that the thread has read."""
        while self._waiting and not self._stopped.is_set():
            self._on_message(self._waiting.popleft())

    def stop(self) -> None:
        """Ask the thread to end."""
        self._stopped.set()

    def join(self) -> None:
        """Wait for the thread; at most one of its waits."""
        self._thread.join()
