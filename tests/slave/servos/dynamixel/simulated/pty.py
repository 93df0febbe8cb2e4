"""A simulated bus behind a pseudo-terminal: to whoever opens it, a serial port with servos."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import tty
from collections.abc import Callable

from common.clock import Clock, monotonic_ns
from tests.slave.servos.dynamixel.simulated.bus import SimulatedBus

_LOOK_S = 0.02
"""Between looks at whether to end, and at what moves by itself."""
_JOIN_S = 2.0


class SimulatedPort:
    """Serves a bus from a thread of its own for as long as it is entered.

    `garble` may change the bytes of every answer, as a bad cable does.
    """

    def __init__(
        self,
        bus: SimulatedBus,
        clock: Clock = monotonic_ns,
        garble: Callable[[bytes], bytes] | None = None,
    ) -> None:
        self.bus = bus
        self.lock = threading.Lock()
        """Hold it to look at the servos, or to change them."""
        self.garble = garble
        self._clock = clock
        self._ended = threading.Event()
        self._outer, inner = os.openpty()
        tty.setraw(inner)
        self.device = os.ttyname(inner)
        """What to open."""
        # kept open, or the port would be gone between two who open it
        self._inner = inner
        self._thread = threading.Thread(target=self._serve, name="simulated servos", daemon=True)

    def __enter__(self) -> SimulatedPort:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.pull()

    def pull(self) -> None:
        """Pull the adapter out: the port is gone for good. Safe to call twice."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._thread.join(_JOIN_S)
        for descriptor in (self._outer, self._inner):
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def _serve(self) -> None:
        while not self._ended.is_set():
            ready = select.select([self._outer], [], [], _LOOK_S)[0]
            data = os.read(self._outer, 4096) if ready else b""
            with self.lock:
                if not data:
                    self.bus.parser.quiet()
                answer = self.bus.feed(data, self._clock())
                self.bus.advance(self._clock())
            if answer and self.garble:
                answer = self.garble(answer)
            while answer:
                answer = answer[os.write(self._outer, answer) :]
